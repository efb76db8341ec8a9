"""Settings of the machine, stored in Blender's preferences and not in .blend files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from ..engine.device.device_info import DeviceSurvey
from ..engine.setting_types import PREFERENCES
from ..engine.settings import Settings, shown_in
from .devices import finder
from .extension import EXTENSION
from .report_message import report_message
from .setting_properties import setting_properties, setting_values
from .user_files import clear_cache
from .worker_manager import poll_idle


class HemibakePreferences:
    """Properties of the settings in Blender's Preferences; the class in `panels` inherits and draws them."""

    bl_idname = EXTENSION
    __annotations__ = setting_properties(shown_in(PREFERENCES), Settings())


def machine_properties() -> bpy.types.AddonPreferences | None:
    """Return the preferences; None if a script enabled the add-on without an entry in them."""
    entry = bpy.context.preferences.addons.get(EXTENSION)
    return None if entry is None else entry.preferences


def machine_settings() -> dict[str, Any]:
    """Return the machine's settings for the engine; settings that are not stored have their defaults."""
    properties = machine_properties()
    return {} if properties is None else setting_values(properties, shown_in(PREFERENCES))


def known_devices() -> DeviceSurvey | None:
    """Return the devices of the machine; None during the search, which the first call starts."""
    if finder.found is None and not finder.busy:
        finder.start(_chosen_device())
    return finder.found


def guide_page(page: str = "user/guide.md") -> Path | None:
    """Return a page of the guide by its path in docs: HTML in a package, Markdown in a checkout.

    Return None without the page.
    """
    root = Path(__file__).parents[1]
    pages = ((root / "guide" / page).with_suffix(".html"), root / "docs" / page)
    return next((found for found in pages if found.is_file()), None)


def _chosen_device() -> str | None:
    return machine_settings().get("opencl_device")


class HEMIBAKE_OT_find_devices(bpy.types.Operator):
    """Search for devices again, and show which of them bakes use"""

    bl_idname = "hemibake.find_devices"
    bl_label = "Find Devices"
    bl_options = {"INTERNAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        if bpy.app.background:
            finder.find(_chosen_device())
        else:
            finder.start(_chosen_device())
        return {"FINISHED"}


class HEMIBAKE_OT_clear_cache(bpy.types.Operator):
    """Remove compiled kernels and checkpoints of interrupted bakes; the next bake compiles kernels again"""

    bl_idname = "hemibake.clear_cache"
    bl_label = "Clear Cache"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_idle(cls)

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            clear_cache()
        except OSError as error:
            report_message(self, "ERROR", f"Some files stay: {error}. Close other Blenders, then try again.")
            return {"CANCELLED"}
        return {"FINISHED"}


CLASSES = (HEMIBAKE_OT_find_devices, HEMIBAKE_OT_clear_cache)
