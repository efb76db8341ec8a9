"""Runs Blender's glTF exporter with this add-on's hooks, which exist only during one export."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from ...engine.errors import EngineError
from ..extension import EXTENSION

#: Name under which the exporter looks for hooks in the modules of all enabled add-ons.
_NAME = "glTF2ExportUserExtension"

#: Options of Blender's exporter that give the state of the bake: evaluated meshes in the pose of the current
#: frame, and no lights whose light is in the lightmaps.
_OPTIONS = {
    "export_apply": True,
    "export_gn_mesh": True,
    "export_skins": False,
    "export_morph": False,
    "export_animations": False,
    "export_current_frame": True,
    "export_lights": False,
    "export_cameras": True,
    "export_draco_mesh_compression_enable": False,
    "use_active_scene": True,
    "use_visible": True,
    "use_renderable": True,
}


_FAILED = (
    "Blender's glTF exporter failed: {}. Check materials and objects for NaN values; warnings of the last "
    "bake name them."
)


def write_gltf(path: Path, hooks: object, with_attributes: bool) -> None:
    """Write the visible objects of the scene as .glb or .gltf, by the suffix of the path; raises EngineError.

    hooks:            an object with the exporter's hooks as methods
    with_attributes:  True to offer the attributes of meshes to the hooks
    """
    if not hasattr(bpy.types, "EXPORT_SCENE_OT_gltf"):
        raise EngineError(
            "Blender's glTF exporter is missing. Enable the add-on 'glTF 2.0 format' in the preferences."
        )
    kind = "GLB" if path.suffix.lower() == ".glb" else "GLTF_SEPARATE"
    try:
        with _hooked(hooks):
            bpy.ops.export_scene.gltf(
                filepath=str(path),
                check_existing=False,
                export_format=kind,
                export_attributes=with_attributes,
                **_OPTIONS,
            )
    except RuntimeError as error:
        raise EngineError(_FAILED.format(_last_line(error))) from error


def _last_line(error: RuntimeError) -> str:
    """Return the reason from an operator's error text: the line after the traceback, without the location."""
    lines = [line.strip() for line in str(error).splitlines()]
    return [line for line in lines if line and not line.startswith("Location:")][-1]


@contextmanager
def _hooked(hooks: object) -> Iterator[None]:
    """Install hooks for the exporter; remove them at the end of the `with` block."""
    module = sys.modules[EXTENSION]
    setattr(module, _NAME, lambda: hooks)
    try:
        yield
    finally:
        delattr(module, _NAME)
