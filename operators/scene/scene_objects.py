"""Objects and instances as they were read, before it is decided where their charts go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ...engine.naming import naming
from .materials.material_table import MaterialTable
from .messages import NO_FACES, NO_UVS, NORMALS_NOT_FINITE, NOT_FINITE, NOT_FINITE_UVS, Troubles
from .objects.extent import middle_of, trouble_with
from .objects.items import SceneItem
from .objects.meshes import LIGHTMAP_UVS, Corners, read_corners
from .uvs.lightmap_layer import lightmap_layer
from .uvs.uv_faults import is_finite
from .uvs.uv_modifier import uv_source


@dataclass(frozen=True)
class Shape:
    """A mesh in object space, one for all that show it.

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
    uvs            session uid of what its UVs come from, see `uv_source`
    matrix         (4, 4) float64, object space to world space
    scale          factor on its texels per metre
    """

    name: str
    source: int
    uvs: int
    instancer: int | None
    persistent_id: tuple[int, ...]
    atlas: str | None
    matrix: np.ndarray
    shape: Shape
    scale: float

    @property
    def box(self) -> np.ndarray:
        """Corners of the bounding box in world space, (8, 3) float64."""
        with np.errstate(invalid="ignore", over="ignore"):
            return self.shape.box @ self.matrix[:3, :3].T + self.matrix[:3, 3]


class ItemReader:
    """Reads what a scene shows, each mesh once, and collects what there is to say about it.

    baked  session uids of the objects that get a lightmap
    """

    def __init__(
        self,
        depsgraph: bpy.types.Depsgraph,
        table: MaterialTable,
        baked: set[int],
        uv_layer: str,
        notes: list[str],
        troubles: Troubles,
    ) -> None:
        self._depsgraph, self._table, self._baked = depsgraph, table, baked
        self._uv_layer, self._notes, self._troubles = uv_layer, notes, troubles
        self._shapes: dict[tuple, Shape | str] = {}
        self._readings: list[Reading] = []
        self._degenerate: dict[str, int] = {}

    def add(self, item: SceneItem) -> None:
        """Read an object or instance with faces."""
        if item.source.hemibake.role == "IGNORED" or self._instancer_ignored(item):
            return
        atlas = item.source.hemibake.atlas if self._gets_lightmap(item) else None
        shape = self._shape(item, atlas)
        if isinstance(shape, str):
            self._troubles.add(shape, item.source.name)
            return
        trouble = None if atlas is None else _uv_trouble(shape.corners.uvs)
        if trouble:
            self._troubles.add(trouble, item.source.name)
        instancer = item.instancer
        self._readings.append(
            Reading(
                name=item.source.name,
                source=item.source.session_uid,
                uvs=uv_source(item.source, self._uv_layer),
                instancer=None if instancer is None else instancer.session_uid,
                persistent_id=item.persistent_id,
                atlas=None if trouble else atlas,
                matrix=item.matrix,
                shape=shape,
                scale=item.source.hemibake.lightmap_scale,
            )
        )

    def finish(self) -> tuple[list[Reading], np.ndarray]:
        """Return what was read, and the point that positions are relative to, (3,) float64, world space."""
        if self._degenerate:
            names, count = sorted(self._degenerate), sum(self._degenerate.values())
            sentence = f"{_objects(names)}: {count} zero-area triangles were left out."
            self._notes.append(naming(sentence, names))
        middle = middle_of([reading.box for reading in self._readings])
        near = []
        for reading in self._readings:
            trouble = trouble_with(reading.box, middle)
            if trouble:
                self._troubles.add(trouble, reading.name)
            else:
                near.append(reading)
        return near, middle

    def _instancer_ignored(self, item: SceneItem) -> bool:
        return item.instancer is not None and item.instancer.hemibake.role == "IGNORED"

    def _gets_lightmap(self, item: SceneItem) -> bool:
        """Return whether an item is to be baked: an object that is, shown by one that is no mere occluder."""
        if item.source.session_uid not in self._baked:
            return False
        return item.instancer is None or item.instancer.hemibake.role == "BAKED"

    def _shape(self, item: SceneItem, atlas: str | None) -> Shape | str:
        """Return an item's mesh, or why it is left out."""
        materials = _slot_materials(item)
        slots = [self._table.index(material, atlas, item) for material in materials]
        layer = lightmap_layer(item.source, self._uv_layer)
        key = (item.object.data.as_pointer(), layer, tuple(slots), atlas is None)
        if key not in self._shapes:
            self._shapes[key] = self._read(item, slots, atlas)
        return self._shapes[key]

    def _read(self, item: SceneItem, slots: Sequence[int], atlas: str | None) -> Shape | str:
        """Read an item's mesh; of one that is being edited Blender has to make it."""
        if item.source.type != "MESH" or not item.source.data.is_editmode:
            return self._read_mesh(item, item.object.data, slots, atlas)
        try:
            return self._read_mesh(item, item.object.to_mesh(), slots, atlas)
        finally:
            item.object.to_mesh_clear()

    def _read_mesh(
        self, item: SceneItem, mesh: bpy.types.Mesh, slots: Sequence[int], atlas: str | None
    ) -> Shape | str:
        lightmap = lightmap_layer(item.source, self._uv_layer)
        layer = None if atlas is None or lightmap not in mesh.uv_layers else lightmap
        maps = {name: name for name in self._table.uv_maps(slots)}
        if LIGHTMAP_UVS in maps:
            maps[LIGHTMAP_UVS] = lightmap
        corners = read_corners(mesh, layer, maps)
        if corners.dropped:
            self._degenerate[item.source.name] = corners.dropped
        if not len(corners.positions):
            return NO_FACES
        if not np.isfinite(corners.positions).all():
            return NOT_FINITE
        if not np.isfinite(corners.normals).all():
            return NORMALS_NOT_FINITE
        self._table.keep(item, slots)
        index = np.clip(corners.slot, 0, len(slots) - 1)
        return Shape(corners, np.asarray(slots, np.int32)[index], _box(corners.positions))


def _uv_trouble(uvs: np.ndarray | None) -> str | None:
    """Return what is wrong with lightmap UVs wherever they are in an atlas."""
    if uvs is None:
        return NO_UVS
    return None if is_finite(uvs) else NOT_FINITE_UVS


def _box(positions: np.ndarray) -> np.ndarray:
    """Return the corners of the box around triangles, (8, 3) float64."""
    bounds = np.stack([positions.min(axis=(0, 1)), positions.max(axis=(0, 1))]).astype(np.float64)
    return np.stack(np.meshgrid(*bounds.T, indexing="ij"), axis=-1).reshape(8, 3)


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
