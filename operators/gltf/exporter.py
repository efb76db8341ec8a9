"""Blender's own glTF exporter, with hooks of ours for the length of one export."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from ...engine.errors import EngineError
from ..extension import EXTENSION

#: Where the exporter looks for hooks, in the modules of all add-ons that are enabled.
_NAME = "glTF2ExportUserExtension"

#: What was baked is what is exported: meshes as their modifiers make them, in the pose of this frame, without
#: the lamps whose light the lightmaps have.
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
    "Blender's glTF exporter failed: {}. Look for values that are NaN in materials and objects, which "
    "warnings of the last bake name."
)


def write_gltf(path: Path, hooks: object) -> None:
    """Write the visible objects of the scene as .glb or .gltf, as the name ends; raises EngineError.

    hooks: an object that has the exporter's hooks as methods
    """
    if not hasattr(bpy.types, "EXPORT_SCENE_OT_gltf"):
        raise EngineError(
            "Blender's glTF exporter is not there. Enable the add-on 'glTF 2.0 format' in the preferences."
        )
    kind = "GLB" if path.suffix.lower() == ".glb" else "GLTF_SEPARATE"
    try:
        with _hooked(hooks):
            bpy.ops.export_scene.gltf(
                filepath=str(path), check_existing=False, export_format=kind, **_OPTIONS
            )
    except RuntimeError as error:
        raise EngineError(_FAILED.format(_last_words(error))) from error


def _last_words(error: RuntimeError) -> str:
    """Return what went wrong, which an operator's error tells after a traceback and before the place."""
    lines = [line.strip() for line in str(error).splitlines()]
    return [line for line in lines if line and not line.startswith("Location:")][-1]


@contextmanager
def _hooked(hooks: object) -> Iterator[None]:
    """Let the exporter find hooks; no other export does."""
    module = sys.modules[EXTENSION]
    setattr(module, _NAME, lambda: hooks)
    try:
        yield
    finally:
        delattr(module, _NAME)
