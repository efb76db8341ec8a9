"""The materials of a bake: each read once, and those that only Blender can evaluate baked by it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import bpy

from ...engine.scene import Material
from .materials import read_material


class MaterialTable:
    """Collects the materials of all objects while they are read.

    uv_layer  name of the lightmap UV layer
    notes     sentences for the user are appended here
    """

    def __init__(self, uv_layer: str, notes: list[str]) -> None:
        self._uv_layer, self._notes = uv_layer, notes
        self._index: dict[int | None, int] = {}
        self._materials: list[Material] = []

    def index(self, material: bpy.types.Material | None, atlas: str | None) -> int:
        """Return the index into `Scene.materials` of a material on objects of an atlas (None: occluders)."""
        key = None if material is None else material.session_uid
        if key not in self._index:
            self._index[key] = len(self._materials)
            self._materials.append(read_material(material, self._notes))
        return self._index[key]

    def uv_maps(self, indices: Iterable[int]) -> set[str]:
        """Return the UV maps that textures of some materials need; "" is the one that renders use."""
        return set()

    def keep(self, mesh: bpy.types.Mesh, indices: Sequence[int]) -> None:
        """Keep a copy of an evaluated mesh if Blender has to evaluate one of its slots' materials on it."""

    def finish(self, resolution: int) -> tuple[Material, ...]:
        """Evaluate what is left to Blender at a resolution, and return all materials."""
        return tuple(self._materials)
