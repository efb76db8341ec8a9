"""Objects and instances as they were read, before it is decided where their charts go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ...engine.naming import naming
from .copies import copying_modifiers
from .items import SceneItem
from .material_table import MaterialTable
from .meshes import Corners, read_corners


@dataclass(frozen=True)
class Shape:
    """A mesh in object space, shared by all that show it.

    corners  its triangles
    slots    (t,) int32, index into `Scene.materials` of each triangle
    box      (8, 3) float64
    """

    corners: Corners
    slots: np.ndarray
    box: np.ndarray


@dataclass(frozen=True)
class Reading:
    """One object or instance.

    name           of the object shown
    source         its session uid
    instancer      session uid of the object that makes the instance, None for an object
    persistent_id  Blender's number of the instance
    atlas          name of the atlas its charts go to, None for an occluder
    mesh           session uid of the mesh whose UVs it has
    matrix         (4, 4) float64, object space to world space
    """

    name: str
    source: int
    mesh: int
    instancer: int | None
    persistent_id: tuple[int, ...]
    atlas: str | None
    matrix: np.ndarray
    shape: Shape

    @property
    def box(self) -> np.ndarray:
        """Corners of the bounding box in world space, (8, 3) float64."""
        return self.shape.box @ self.matrix[:3, :3].T + self.matrix[:3, 3]


class ItemReader:
    """Reads what a scene shows, each mesh once, and collects what there is to say about it.

    baked    session uids of the objects that get a lightmap
    copying  names of the modifiers that make lightmap UVs overlap, by object
    """

    def __init__(
        self,
        depsgraph: bpy.types.Depsgraph,
        table: MaterialTable,
        baked: set[int],
        uv_layer: str,
        notes: list[str],
    ) -> None:
        self._depsgraph, self._table, self._baked = depsgraph, table, baked
        self._uv_layer, self._notes = uv_layer, notes
        self._shapes: dict[tuple, Shape | None] = {}
        self._readings: list[Reading] = []
        self._generated: list[str] = []
        self._faceless: list[str] = []
        self._degenerate: dict[str, int] = {}
        self.copying: dict[str, list[str]] = {}

    def add(self, item: SceneItem) -> None:
        """Read an object or instance with faces."""
        if item.source.hemibake.role == "IGNORED" or self._instancer_ignored(item):
            return
        atlas = item.source.hemibake.atlas if self._gets_lightmap(item) else None
        shape = self._shape(item, atlas)
        if shape is None:
            return
        instancer = item.instancer
        self._readings.append(
            Reading(
                name=item.source.name,
                source=item.source.session_uid,
                mesh=item.source.data.session_uid,
                instancer=None if instancer is None else instancer.session_uid,
                persistent_id=item.persistent_id,
                atlas=atlas if shape.corners.uvs is not None else None,
                matrix=item.matrix,
                shape=shape,
            )
        )

    def finish(self) -> list[Reading]:
        """Return what was read, and say what is special about some of it."""
        if self._faceless:
            names = sorted(set(self._faceless))
            verb = "has no faces and is" if len(names) == 1 else "have no faces and are"
            self._notes.append(naming(f"{_objects(names)} {verb} left out.", names))
        if self._generated:
            names = sorted(set(self._generated))
            sentence = (
                f"{_objects(names)}: faces made by modifiers have no lightmap UVs. They are seen and reflect "
                "but get no lightmap: apply the modifiers to bake them."
            )
            self._notes.append(naming(sentence, names))
        if self._degenerate:
            names, count = sorted(self._degenerate), sum(self._degenerate.values())
            sentence = f"{_objects(names)}: {count} zero-area triangles were left out."
            self._notes.append(naming(sentence, names))
        return self._readings

    def _instancer_ignored(self, item: SceneItem) -> bool:
        return item.instancer is not None and item.instancer.hemibake.role == "IGNORED"

    def _gets_lightmap(self, item: SceneItem) -> bool:
        """Return whether an item is to be baked: an object that is, shown by one that is no mere occluder."""
        if item.source.session_uid not in self._baked:
            return False
        return item.instancer is None or item.instancer.hemibake.role == "BAKED"

    def _shape(self, item: SceneItem, atlas: str | None) -> Shape | None:
        """Return an item's mesh; None if it has no faces."""
        materials = _slot_materials(item)
        slots = [self._table.index(material, atlas) for material in materials]
        key = (item.object.data.as_pointer(), tuple(slots), atlas is None)
        if key not in self._shapes:
            self._shapes[key] = self._read(item, slots, atlas)
        return self._shapes[key]

    def _read(self, item: SceneItem, slots: Sequence[int], atlas: str | None) -> Shape | None:
        """Read an item's mesh; of one that is being edited Blender has to make it."""
        if item.source.type != "MESH" or not item.source.data.is_editmode:
            return self._read_mesh(item, item.object.data, slots, atlas)
        try:
            return self._read_mesh(item, item.object.to_mesh(), slots, atlas)
        finally:
            item.object.to_mesh_clear()

    def _read_mesh(
        self, item: SceneItem, mesh: bpy.types.Mesh, slots: Sequence[int], atlas: str | None
    ) -> Shape | None:
        obj = item.object
        if not len(mesh.polygons):
            self._faceless.append(item.source.name)
            return None
        layer = self._uv_layer
        has_layer = layer in mesh.uv_layers
        if atlas is not None and not has_layer:
            self._generated.append(item.source.name)
        elif atlas is not None:
            copying = copying_modifiers(item.source, mesh, layer)
            if copying:
                self.copying[item.source.name] = copying
        corners = read_corners(
            mesh, layer if atlas is not None and has_layer else None, self._table.uv_maps(slots)
        )
        if corners.dropped:
            self._degenerate[item.source.name] = corners.dropped
        if not len(corners.positions):
            self._faceless.append(item.source.name)
            return None
        self._table.keep(obj, slots)
        index = np.clip(corners.slot, 0, len(slots) - 1)
        box = np.array(obj.bound_box, np.float64)
        return Shape(corners, np.asarray(slots, np.int32)[index], box)


def _objects(names: Sequence[str]) -> str:
    """Return the beginning of a sentence for `naming`."""
    return "Object {}" if len(names) == 1 else "Objects {}"


def _slot_materials(item: SceneItem) -> list[bpy.types.Material | None]:
    """Return the material of each slot: the object's own where the slot is linked to the object.

    While the object shows its lightmap, the slots as they were before the preview count.
    """
    obj = item.source
    materials = [material and material.original for material in item.object.data.materials]
    slots = obj.hemibake.slots or obj.material_slots
    for index, slot in enumerate(slots):
        if slot.link == "OBJECT" and index < len(materials):
            materials[index] = slot.material
    return materials or [None]
