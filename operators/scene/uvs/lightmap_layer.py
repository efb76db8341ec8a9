"""Names the lightmap UV layer of an object, and ranks UV layers by how likely they hold lightmap UVs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ..objects.meshes import read_array, read_uvs
from .uv_faults import is_finite, is_inside, overlap

#: Lower-case parts of the names that users and other programs give to lightmap UV layers.
_NAMES = ("light", "bake", "uv2", "uvmap2", "uvmap.001", "uvchannel_2", "texcoord_1", "st1")

#: Limits of the overlap test before the list of layers is displayed: loops in total, and meshes per layer
#: name.
_MOST_TRIANGLES, _MOST_MESHES = 20_000, 4


def lightmap_layer(obj: bpy.types.Object, uv_layer: str) -> str:
    """Return the name of an object's lightmap UV layer: its own setting, else the scene's (`uv_layer`)."""
    return obj.hemibake.own_uv_layer or uv_layer


@dataclass
class _Layer:
    """UV layers of one name on several meshes.

    meshes:  the meshes that have a layer of this name
    first:   True if a mesh has several layers and this one is its first
    usable:  True if it has no overlaps and stays within 0-1 on each mesh that was checked
    """

    name: str
    meshes: list[bpy.types.Mesh]
    first: bool = False
    usable: bool = True

    @property
    def rank(self) -> tuple:
        """Sort key for a list of layers: those most likely to hold lightmap UVs come first."""
        named = any(word in self.name.lower() for word in _NAMES)
        return (not self.usable, not named, self.first, -len(self.meshes), self.name)


def offered_layers(objects: Iterable[bpy.types.Object]) -> list[tuple[str, str]]:
    """Return name and description of the UV layers of objects, the most likely lightmap UVs first."""
    meshes = list(dict.fromkeys(obj.data for obj in objects if obj.type == "MESH"))
    layers: dict[str, _Layer] = {}
    for mesh in meshes:
        for number, layer in enumerate(mesh.uv_layers):
            known = layers.setdefault(layer.name, _Layer(layer.name, []))
            known.meshes.append(mesh)
            known.first |= number == 0 and len(mesh.uv_layers) > 1
    left = _MOST_TRIANGLES
    for layer in layers.values():
        for mesh in sorted(layer.meshes, key=lambda mesh: len(mesh.loops))[:_MOST_MESHES]:
            left -= len(mesh.loops)
            if left < 0:
                break
            layer.usable = layer.usable and _usable(mesh, layer.name)
    ordered = sorted(layers.values(), key=lambda layer: layer.rank)
    return [(layer.name, _describe(layer, len(meshes))) for layer in ordered]


def layer_triangles(mesh: bpy.types.Mesh, name: str) -> np.ndarray:
    """Return the UVs of a layer at the corners of the mesh's triangles, (t, 3, 2) float32."""
    mesh.calc_loop_triangles()
    loops = read_array(mesh.loop_triangles, "loops", 3, np.int32)
    return read_uvs(mesh.uv_layers[name])[loops]


def _usable(mesh: bpy.types.Mesh, name: str) -> bool:
    """Return True if a layer's UVs are finite, within 0-1 and free of overlaps; True in edit mode."""
    if mesh.is_editmode:
        return True
    uvs = layer_triangles(mesh, name)
    return is_finite(uvs) and is_inside(uvs) and not overlap(uvs)


def _describe(layer: _Layer, meshes: int) -> str:
    parts: Sequence[str] = (
        "" if meshes < 2 else f"on {len(layer.meshes)} of {meshes} meshes",
        "" if layer.usable else "overlaps, or leaves 0-1",
        "first layer" if layer.first else "",
    )
    return ", ".join(filter(None, parts))
