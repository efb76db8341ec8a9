"""Modifiers that copy faces together with their lightmap UVs."""

from __future__ import annotations

import bpy
import numpy as np

from .meshes import read_array

#: Modifiers that may make several faces of one; others that are on are not named beside these.
_COPYING = {"ARRAY", "BOOLEAN", "MIRROR", "NODES", "SCREW", "SOLIDIFY"}

#: Least share of faces that lie on others.
_SHARE = 0.005

#: Faces are at the same place if their UVs agree to this many parts of the lightmap's width.
_STEPS = 1 << 16

#: Largest number of objects that a message names.
_NAMED = 5


def copying_modifiers(obj: bpy.types.Object, mesh: bpy.types.Mesh, uv_layer: str) -> list[str]:
    """Return the names of an object's modifiers if its evaluated mesh has copies of faces in UV space."""
    layer = mesh.uv_layers.get(uv_layer)
    if layer is None or len(mesh.polygons) <= len(obj.data.polygons):
        return []
    if _copied_share(read_array(layer.uv, "vector", 2, np.float32), mesh) < _SHARE:
        return []
    active = [modifier for modifier in obj.modifiers if modifier.show_viewport]
    return [modifier.name for modifier in active if modifier.type in _COPYING] or [
        modifier.name for modifier in active
    ]


def _copied_share(uvs: np.ndarray, mesh: bpy.types.Mesh) -> float:
    """Return the share of faces whose UVs, (l, 2) of each loop, another face has in any order."""
    starts = read_array(mesh.polygons, "loop_start", 1, np.int32)[:, 0]
    low, high = np.minimum.reduceat(uvs, starts), np.maximum.reduceat(uvs, starts)
    places = np.concatenate([low, high, np.add.reduceat(uvs, starts)], axis=1)
    places = places[((high - low) * _STEPS > 1).all(axis=1)]
    return 1 - len(np.unique(np.round(places * _STEPS), axis=0)) / max(1, len(places))


def copies_message(copying: dict[str, list[str]], uv_layer: str) -> str:
    """Return what to do about the modifiers of each object in `copying`."""
    parts = [f"{_quoted(names)} of '{obj}'" for obj, names in copying.items()]
    more = f" and of {len(parts) - _NAMED} more objects" if len(parts) > _NAMED else ""
    return (
        "Modifiers copy faces together with their lightmap UVs, which then overlap. Apply the modifiers "
        f"{'; '.join(parts[:_NAMED])}{more}, then bake. If such an object had the UV layer '{uv_layer}' "
        "before, delete that layer, too."
    )


def _quoted(names: list[str]) -> str:
    return ", ".join(f"'{name}'" for name in names)
