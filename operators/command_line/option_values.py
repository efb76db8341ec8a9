"""Applies the values of options to the settings of the scene and of the machine."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from ...engine.setting_types import PREFERENCES
from ...engine.settings import kept_with_scene, shown_in
from .options import OWN, CommandError

if TYPE_CHECKING:
    import bpy


def apply_settings(options: argparse.Namespace) -> None:
    """Copy the given options to the scene's settings and, for this process, to the machine's preferences."""
    import bpy

    scene = bpy.context.scene.hemibake
    scene.directory = str(options.out.resolve())
    given = {name: value for name, value in vars(options).items() if value is not None}
    if "resolution" in given:
        scene.size_mode = "SIZE"
    if "texels_per_metre" in given:
        scene.size_mode = "DENSITY"
    for name in [name for name in ("quality", *kept_with_scene(), *OWN) if name in given]:
        _apply(scene, name, given[name])
    for name in given.keys() & set(shown_in(PREFERENCES)):
        _apply(_preferences(), name, given[name])


def _preferences() -> bpy.types.AddonPreferences:
    """Return the preferences of the add-on, whichever repository it was installed from."""
    import bpy

    addons = bpy.context.preferences.addons
    return next(addon.preferences for addon in addons if addon.module.rpartition(".")[2] == "hemibake")


def _apply(settings: bpy.types.bpy_struct, name: str, value: object) -> None:
    """Set a setting to the value of its option; raises CommandError if it is refused."""
    try:
        setattr(settings, name, value)
    except (TypeError, ValueError, OverflowError) as error:
        raise CommandError(_refusal(settings.bl_rna.properties[name], value)) from error


def _refusal(setting: bpy.types.Property, value: object) -> str:
    """Return the reason why a setting refuses a value."""
    if setting.type == "ENUM":
        typed = ", ".join(sorted(value)) if isinstance(value, set) else str(value)
        return f"{setting.identifier} is {typed}; choose one of {', '.join(setting.enum_items.keys())}."
    return f"{setting.identifier} is {value}, which is far out of its range."
