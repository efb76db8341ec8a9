"""Hemibake in Blender's preferences: devices, self-test, files."""

from __future__ import annotations

from importlib.util import find_spec

import bpy

from ..engine.device.device_info import DeviceInfo
from ..engine.setting_types import PREFERENCES
from ..engine.settings import shown_in
from ..operators.preferences import HemibakePreferences, guide, known_devices
from ..operators.self_test import last_test
from ..operators.user_files import cache_folder, cache_size, log_file
from .sidebar import split_properties
from .wrapped_text import draw_text, line_width

#: What empty texts stand for, and why there is no scheduler.
_EMPTY = {"opencl_device": "Automatic", "scheduler": "One device"}
_NO_DASK = "Needs Hemibake's package with Dask"

#: Part of a row that a path has, beside a button.
_BESIDE = 0.8


class HEMIBAKE_AP_preferences(HemibakePreferences, bpy.types.AddonPreferences):
    """What describes the machine, and whether it works."""

    def draw(self, context: bpy.types.Context) -> None:
        layout, width = self.layout, line_width(context)
        _draw_devices(layout.box(), width)
        settings = layout.column()
        split_properties(settings)
        for name in shown_in(PREFERENCES):
            _draw_setting(settings.row(), self, name)
        _draw_test(layout.box(), width)
        _draw_files(layout.box())


def _draw_setting(row: bpy.types.UILayout, owner: HemibakePreferences, name: str) -> None:
    """Show a setting, with what is used where a text is empty; greyed with the reason where nothing can."""
    row.enabled = name != "scheduler" or find_spec("distributed") is not None
    if name in _EMPTY:
        row.prop(owner, name, placeholder=_EMPTY[name] if row.enabled else _NO_DASK)
    else:
        row.prop(owner, name)


def _draw_devices(layout: bpy.types.UILayout, width: float) -> None:
    """Show every device, and what is missing."""
    head = layout.row()
    head.label(text="Devices")
    head.operator("hemibake.find_devices", text="", icon="FILE_REFRESH")
    survey = known_devices()
    if survey is None:
        layout.label(text="Looking for devices …", icon="SORTTIME")
        return
    for device in survey.devices:
        _draw_device(layout.column(align=True), device, width)
    for sentence in survey.missing:
        draw_text(layout, sentence, width, "ERROR")


def _draw_device(layout: bpy.types.UILayout, device: DeviceInfo, width: float) -> None:
    """Show a device: name, driver, memory, use."""
    icon = "ERROR" if device.trouble else "CHECKMARK" if device.use else "DOT"
    draw_text(layout, f"{device.api}: {device.name}", width, icon)
    memory = f"{device.memory / 2**30:.1f} GiB" if device.memory else ""
    use = f"used for {device.use}" if device.use else "not used"
    draw_text(layout, ", ".join(filter(None, [memory, use, device.trouble])), width, "BLANK1")
    draw_text(layout, f"Driver {device.driver}", width, "BLANK1")


def _draw_test(layout: bpy.types.UILayout, width: float) -> None:
    """Show the button of the test, and what the last one told."""
    layout.operator("hemibake.self_test", text="Self-Test", icon="VIEWZOOM")
    first = {None: "SORTTIME", True: "CHECKMARK", False: "ERROR"}[last_test.right]
    for number, line in enumerate(last_test.text.splitlines()):
        draw_text(layout, line, width, "ERROR" if number else first)


def _draw_files(layout: bpy.types.UILayout) -> None:
    """Show where the cache and the log are, and where Hemibake is explained."""
    row = layout.split(factor=_BESIDE)
    row.label(text=f"Cache: {cache_size() / 2**20:.1f} MiB in {cache_folder() or 'no folder'}")
    row.operator("hemibake.clear_cache", text="Clear", icon="TRASH")
    _draw_path(layout, "Log", log_file())
    _draw_path(layout, "Guide", guide())


def _draw_path(layout: bpy.types.UILayout, name: str, path: object) -> None:
    """Show a file, with a button that opens it."""
    if path is None:
        return
    row = layout.split(factor=_BESIDE)
    row.label(text=f"{name}: {path}")
    button = row.row()
    button.enabled = path.is_file()
    button.operator("wm.path_open", text="Open", icon="TEXT").filepath = str(path)


CLASSES = (HEMIBAKE_AP_preferences,)
