"""Preferences panel of the add-on: devices, denoiser, settings of the machine, self-test and files."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import bpy

from ..engine.device.device_info import DeviceInfo
from ..engine.setting_types import PREFERENCES
from ..engine.settings import shown_in
from ..operators.denoise_library import denoise_library
from ..operators.preferences import HemibakePreferences, guide_page, known_devices
from ..operators.self_test import last_test
from ..operators.user_files import cache_folder, cache_size, log_file
from .sidebar import split_properties
from .wrapped_text import draw_text, line_width

#: Placeholders of empty text fields.
_EMPTY = {"opencl_device": "Automatic", "scheduler": "One device"}

_NO_DENOISE = (
    "Denoise has no effect: this Blender contains no Open Image Denoise. Use a Blender from blender.org, or "
    "raise Quality instead."
)

#: Fraction of a row for a path, next to a button.
_BESIDE = 0.8


class HEMIBAKE_AP_preferences(HemibakePreferences, bpy.types.AddonPreferences):
    """Settings that belong to the machine and not to a .blend file."""

    def draw(self, context: bpy.types.Context) -> None:
        layout, width = self.layout, line_width(context)
        _draw_devices(layout.box(), width)
        if denoise_library() is None:
            draw_text(layout.box(), _NO_DENOISE, width, "INFO")
        settings = layout.column()
        split_properties(settings)
        for name in shown_in(PREFERENCES):
            if name != "scheduler" or find_spec("distributed") is not None:
                _draw_setting(settings, self, name)
        _draw_test(layout.box(), width)
        _draw_files(layout.box())


def _draw_setting(layout: bpy.types.UILayout, owner: HemibakePreferences, name: str) -> None:
    """Draw a setting, with its placeholder."""
    if name in _EMPTY:
        layout.prop(owner, name, placeholder=_EMPTY[name])
    else:
        layout.prop(owner, name)


def _draw_devices(layout: bpy.types.UILayout, width: float) -> None:
    """Draw all devices, and sentences on missing software."""
    head = layout.row()
    head.label(text="Devices")
    head.operator("hemibake.find_devices", text="", icon="FILE_REFRESH")
    survey = known_devices()
    if survey is None:
        layout.label(text="Searching for devices …", icon="SORTTIME")
        return
    for device in survey.devices:
        _draw_device(layout.column(align=True), device, width)
    for sentence in survey.missing:
        draw_text(layout, sentence, width, "ERROR")


def _draw_device(layout: bpy.types.UILayout, device: DeviceInfo, width: float) -> None:
    """Draw name, memory, use, problem and driver of a device."""
    icon = "ERROR" if device.issue else "CHECKMARK" if device.use else "DOT"
    draw_text(layout, f"{device.api}: {device.name}", width, icon)
    memory = f"{device.memory / 2**30:.1f} GiB" if device.memory else ""
    use = f"used for {device.use}" if device.use else "not used"
    draw_text(layout, ", ".join(filter(None, [memory, use, device.issue])), width, "BLANK1")
    draw_text(layout, f"Driver {device.driver}", width, "BLANK1")


def _draw_test(layout: bpy.types.UILayout, width: float) -> None:
    """Draw the Self-Test button and the result of the last test."""
    layout.operator("hemibake.self_test", text="Self-Test", icon="VIEWZOOM")
    first = {None: "SORTTIME", True: "CHECKMARK", False: "ERROR"}[last_test.right]
    for number, line in enumerate(last_test.text.splitlines()):
        draw_text(layout, line, width, "ERROR" if number else first)


def _draw_files(layout: bpy.types.UILayout) -> None:
    """Draw the paths of the cache, the log and the guide."""
    row = layout.split(factor=_BESIDE)
    row.label(text=f"Cache: {cache_size() / 2**20:.1f} MiB in {cache_folder() or 'no folder'}")
    row.operator("hemibake.clear_cache", text="Clear", icon="TRASH")
    _draw_path(layout, "Log", log_file())
    _draw_path(layout, "Guide", guide_page())


def _draw_path(layout: bpy.types.UILayout, name: str, path: Path | None) -> None:
    """Draw the path of a file, with a button that opens the file."""
    if path is None:
        return
    row = layout.split(factor=_BESIDE)
    row.label(text=f"{name}: {path}")
    button = row.row()
    button.enabled = path.is_file()
    button.operator("wm.path_open", text="Open", icon="TEXT").filepath = str(path)


CLASSES = (HEMIBAKE_AP_preferences,)
