"""Presets of bake settings: bundled presets, and presets in the user's preset folder of Blender."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import bpy
from bl_operators.presets import AddPresetBase

from ..engine.settings import kept_with_scene
from .file_format import format_properties
from .lightmap_size import size_properties

#: Folder of the bundled presets, and subfolder of Blender's preset folders for the user's presets.
_OWN = Path(__file__).parents[1] / "presets" / "bake"
_FOLDER = "hemibake/bake"

#: Properties that belong to a single scene and are not stored in presets.
_APART = ("seed", "patch_file", "planned_width", "automatic_width", "lightmap_side", "file_name")


class Preset(NamedTuple):
    """Preset file: its label, its path, and whether it is bundled with Hemibake (`own`)."""

    name: str
    path: Path
    own: bool


def preset_folders() -> list[str]:
    """Return the preset folders, the folder of bundled presets first."""
    return [str(_OWN), *bpy.utils.preset_paths(_FOLDER)]


def presets() -> Iterator[Preset]:
    """Yield all presets."""
    for folder in preset_folders():
        for path in sorted(Path(folder).glob("*.py")):
            yield Preset(bpy.path.display_name(path.name), path, folder == str(_OWN))


def current_preset(settings: bpy.types.PropertyGroup) -> Preset | None:
    """Return the first preset whose values equal the settings; None without one."""
    return next((preset for preset in presets() if _is_set(preset, settings)), None)


def _is_set(preset: Preset, settings: bpy.types.PropertyGroup) -> bool:
    values = _values(preset.path, preset.path.stat().st_mtime_ns)
    return bool(values) and all(_same(getattr(settings, name, None), value) for name, value in values.items())


def _same(value: Any, wanted: Any) -> bool:
    """Return True if a property equals a preset's value: floats up to float32 precision."""
    if isinstance(wanted, float):
        return isinstance(value, float) and math.isclose(value, wanted, rel_tol=1e-6)
    return (tuple(value) if isinstance(wanted, tuple) and value is not None else value) == wanted


@lru_cache(maxsize=256)
def _values(path: Path, changed: int) -> dict[str, Any]:
    """Return the values of a preset file by name, empty if invalid; `changed` is part of the cache key."""
    try:
        lines = ast.parse(path.read_text(encoding="utf-8")).body
        return {
            target.attr: ast.literal_eval(line.value)
            for line in lines
            if isinstance(line, ast.Assign)
            and isinstance(target := line.targets[0], ast.Attribute)
            and _is_setting(target)
        }
    except (OSError, ValueError, SyntaxError):
        return {}


def _is_setting(target: ast.expr) -> bool:
    """Return True if an assignment sets an attribute of `settings`."""
    return isinstance(target, ast.Attribute) and getattr(target.value, "id", "") == "settings"


class HEMIBAKE_OT_preset_add(AddPresetBase, bpy.types.Operator):
    """Add or remove a preset of the bake settings"""

    bl_idname = "hemibake.preset_add"
    bl_label = "Add Bake Preset"
    preset_menu = "HEMIBAKE_MT_presets"
    preset_subdir = _FOLDER
    preset_defines = ["settings = bpy.context.scene.hemibake"]
    preset_values = [
        f"settings.{name}"
        for name in (*kept_with_scene(), *size_properties(), *format_properties())
        if name not in _APART
    ]

    def execute(self, context: bpy.types.Context) -> set[str]:
        removes = self.remove_name or self.remove_active
        if not removes and self.as_filename(self.name).casefold() in {
            path.stem for path in _OWN.glob("*.py")
        }:
            self.report({"WARNING"}, f"'{self.name}' is a bundled preset. Choose another name")
            return {"CANCELLED"}
        return super().execute(context)


CLASSES = (HEMIBAKE_OT_preset_add,)
