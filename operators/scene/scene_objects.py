"""Reads objects and instances, before places for their charts are chosen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ...engine.object_message import object_message
from ..levels import LevelFinder
from ..object_properties import is_left_out
from ..original_slots import own_slots, shown_materials
from .materials.material_table import MaterialTable
from .materials.tree_nodes import displaces
from .messages import NO_FACES, NO_UVS, NORMALS_NOT_FINITE, NOT_FINITE, NOT_FINITE_UVS, Issues
from .objects.coordinate_limits import coordinate_issue, middle_of
from .objects.items import ItemKey, SceneItem
from .objects.meshes import LIGHTMAP_UVS, Corners, MeshArrays, make_corners, read_mesh
from .objects.strand_ribbons import make_ribbons, simplify_strands
from .objects.strands import read_strands
from .slice_timer import Slices
from .uvs.lightmap_layer import lightmap_layer
from .uvs.uv_digest import digest_of
from .uvs.uv_faults import is_finite
from .uvs.uv_modifier import uv_source


@dataclass(frozen=True)
class SharedMesh:
    """Mesh in object space, shared by all objects and instances that use it.

    corners:    its triangles
    slots:      (t,) int32, index into `Scene.materials` of each triangle
    box:        (8, 3) float64, corners of its bounding box in object space
    uv_digest:  digest of its lightmap UVs, see `uv_digest.digest_of`; empty without any
    """

    corners: Corners
    slots: np.ndarray
    box: np.ndarray
    uv_digest: str


@dataclass(frozen=True)
class ReadObject:
    """One object or instance.

    name:           name of the source object
    source:         its session uid
    uvs:            session uid of its UV source, see `uv_source`
    instancer:      session uid of the object that makes the instance; None for an object
    persistent_id:  Blender's identifier of the instance
    atlas:          name of the atlas for its charts; None for an occluder
    matrix:         (4, 4) float64, object space to world space
    scale:          factor of its texels per metre
    light_group:    name of the light group of its emission
    shape:          its mesh; None until all meshes have been read
    on_vertices:    True if its light is to be stored in its vertices
    """

    name: str
    source: int
    uvs: int
    instancer: int | None
    persistent_id: tuple[int, ...]
    atlas: str | None
    matrix: np.ndarray
    scale: float
    light_group: str
    shape: SharedMesh | None
    on_vertices: bool = False

    @property
    def mesh(self) -> SharedMesh:
        """Its mesh, once all meshes have been read."""
        assert self.shape is not None
        return self.shape

    @property
    def box(self) -> np.ndarray:
        """Corners of the bounding box in world space, (8, 3) float64."""
        with np.errstate(invalid="ignore", over="ignore"):
            return self.mesh.box @ self.matrix[:3, :3].T + self.matrix[:3, 3]


#: Number of loops above which a mesh is announced before it is read, because reading takes long.
_LARGE = 100_000

#: Largest number of triangles for the hair of one particle system or Curves object.
_MOST_HAIR = 1 << 20

_THINNED = (
    "{}: too much hair for a bake, so that fewer and wider strands replace it. Lower the "
    "number of strands or children or their steps, or set the role to Ignored."
)

_DISPLACED = (
    "{}: true displacement is not baked, so the lightmap shows the undisplaced surface. Use a Displace "
    "modifier, or set Displacement of the material to Bump Only."
)

#: Key of a mesh: address of the evaluated mesh, its lightmap UV layer, materials of its slots, and True for
#: occluders.
_MeshKey = tuple[int, str, tuple[int, ...], bool]


@dataclass(frozen=True)
class _Unfinished:
    """A mesh whose triangles have not been made yet.

    arrays:  its geometry as read from Blender
    slots:   index into `Scene.materials` of each material slot
    item:    key of the first object that uses it
    name:    name of that object
    """

    arrays: MeshArrays
    slots: tuple[int, ...]
    item: ItemKey
    name: str


class ItemReader:
    """Reads the objects of a scene, each mesh once, and collects notes on them.

    baked:  session uids of the objects that get a lightmap
    """

    def __init__(
        self, table: MaterialTable, baked: set[int], uv_layer: str, notes: list[str], issues: Issues
    ) -> None:
        self._table, self._baked = table, baked
        self._uv_layer, self._notes, self._issues = uv_layer, notes, issues
        self._unfinished: dict[_MeshKey, _Unfinished] = {}
        self._shapes: dict[_MeshKey, SharedMesh | str] = {}
        self._uv_issues: dict[_MeshKey, str | None] = {}
        self._items: list[tuple[_MeshKey, ReadObject]] = []
        self._degenerate: dict[str, int] = {}
        self._thinned: list[str] = []
        self._displaced_meshes: set[_MeshKey] = set()
        self._displaced: list[str] = []
        self._haired: set[ItemKey] = set()
        levels = LevelFinder()
        self._left_out = {obj.session_uid for obj in bpy.data.objects if is_left_out(obj, levels)}

    @staticmethod
    def is_large(item: SceneItem) -> bool:
        """Return True if reading an object's mesh takes long."""
        return len(item.object.data.loops) > _LARGE

    def add(self, item: SceneItem, override: bpy.types.Material | None) -> None:
        """Read an object or instance with faces; call `finish_meshes` some time before `finish`.

        Raises PixelsNeededError if an image must be read first.

        override:  material of all surfaces, if the view layer has one
        """
        if self._is_left_out(item):
            return
        atlas = item.source.hemibake.atlas if self._gets_lightmap(item) else None
        materials = shown_materials(item.object.data, item.source, override)
        slots = tuple(self._table.index(material, atlas, item) for material in materials)
        layer = lightmap_layer(item.source, self._uv_layer)
        key = (item.object.data.as_pointer(), layer, slots, atlas is None)
        if key not in self._shapes and key not in self._unfinished:
            arrays = self._read(item, layer, slots, atlas)
            self._unfinished[key] = _Unfinished(arrays, slots, item.key, item.source.name)
            used = np.unique(np.clip(arrays.slot, 0, len(materials) - 1))
            if any(displaces(materials[slot]) for slot in used):
                self._displaced_meshes.add(key)
        if key in self._displaced_meshes:
            self._displaced.append(item.source.name)
        self._items.append((key, self._reading(item, atlas)))

    def add_hair(
        self, item: SceneItem, depsgraph: bpy.types.Depsgraph, override: bpy.types.Material | None
    ) -> None:
        """Read the hair of an object or instance as thin ribbons, which are occluders.

        Raises PixelsNeededError if an image must be read first; then call this again.

        override:  material of all surfaces, if the view layer has one
        """
        if self._is_left_out(item):
            return
        if item.key in self._haired:
            return
        found = read_strands(item.object, depsgraph)
        materials = [slot.material for slot in own_slots(item.source)] or [None]
        worn = [override or materials[min(strands.slot, len(materials) - 1)] for strands in found]
        slots = [self._table.index_of_strands(material, item) for material in worn]
        self._haired.add(item.key)
        for number, (strands, slot) in enumerate(zip(found, slots, strict=True)):
            key = (item.source.session_uid, f"hair {number}", (slot,), True)
            if key not in self._shapes:
                kept = simplify_strands(strands, _MOST_HAIR)
                if kept is not strands:
                    self._thinned.append(item.source.name)
                self._shapes[key] = _shape(make_ribbons(kept), (slot,), None)
            self._items.append((key, self._reading(item, None)))

    def finish_meshes(self) -> Slices[None]:
        """Make the triangles of the meshes that have been read."""
        for key in list(self._unfinished):
            mesh = self._unfinished.pop(key)
            corners = yield from make_corners(mesh.arrays)
            if corners.dropped and not len(corners.positions):
                self._degenerate[mesh.name] = corners.dropped
            self._shapes[key] = _shape(corners, mesh.slots, mesh.arrays.uvs)
            self._uv_issues[key] = _uv_issue(corners.uvs)
            if not isinstance(self._shapes[key], str):
                self._table.keep(mesh.item, mesh.slots)
            yield 0.0

    def finish(self) -> Slices[tuple[list[ReadObject], np.ndarray]]:
        """Return the objects, and the origin that positions are relative to, (3,) float64 in world space."""
        if self._degenerate:
            names, count = sorted(self._degenerate), sum(self._degenerate.values())
            sentence = f"{_objects(names)}: {count} zero-area triangles were left out."
            self._notes.append(object_message(sentence, names))
        for sentence, found in ((_THINNED, self._thinned), (_DISPLACED, self._displaced)):
            if found:
                self._notes.append(object_message(sentence, sorted(set(found))))
        readings, boxes = [], []
        for reading in self._readings():
            readings.append(reading)
            boxes.append(reading.box)
            yield None
        middle = middle_of(boxes)
        near = []
        for reading, box in zip(readings, boxes, strict=True):
            issue = coordinate_issue(box, middle)
            if issue:
                self._issues.add(issue, reading.name)
            else:
                near.append(reading)
            yield None
        return near, middle

    def _readings(self) -> Iterator[ReadObject]:
        """Yield all objects with their meshes; those with invalid UVs become occluders.

        Objects that only emit instances have no faces of their own, which is no problem.
        """
        instancers = {reading.instancer for _, reading in self._items}
        for key, reading in self._items:
            shape = self._shapes[key]
            if isinstance(shape, str):
                if shape != NO_FACES or reading.source not in instancers:
                    self._issues.add(shape, reading.name)
                continue
            issue = None if reading.atlas is None else self._uv_issues[key]
            if issue:
                self._issues.add(issue, reading.name)
            yield replace(reading, shape=shape, atlas=None if issue else reading.atlas)

    def _reading(self, item: SceneItem, atlas: str | None) -> ReadObject:
        """Return the record of an object, to which its mesh is added later."""
        instancer = item.instancer
        return ReadObject(
            name=item.source.name,
            source=item.source.session_uid,
            uvs=uv_source(item.source, self._uv_layer),
            instancer=None if instancer is None else instancer.session_uid,
            persistent_id=item.persistent_id,
            atlas=atlas,
            matrix=item.matrix,
            scale=item.source.hemibake.lightmap_scale,
            light_group=item.source.lightgroup,
            shape=None,
            on_vertices=item.source.hemibake.bake_to == "VERTICES",
        )

    def _is_left_out(self, item: SceneItem) -> bool:
        """Return True if bakes leave out an object, or the source object or instancer of an instance."""
        owners = (item.source, item.instancer)
        return any(owner is not None and owner.session_uid in self._left_out for owner in owners)

    def _gets_lightmap(self, item: SceneItem) -> bool:
        """Return True if an object is baked; an instance must also have a baked instancer."""
        if item.source.session_uid not in self._baked:
            return False
        return item.instancer is None or item.instancer.hemibake.role == "BAKED"

    def _read(self, item: SceneItem, layer: str, slots: Sequence[int], atlas: str | None) -> MeshArrays:
        """Read an object's mesh; in edit mode Blender must first convert it."""
        if item.source.type != "MESH" or not item.source.data.is_editmode:
            return self._read_mesh(item.object.data, layer, slots, atlas)
        try:
            return self._read_mesh(item.object.to_mesh(), layer, slots, atlas)
        finally:
            item.object.to_mesh_clear()

    def _read_mesh(
        self, mesh: bpy.types.Mesh, layer: str, slots: Sequence[int], atlas: str | None
    ) -> MeshArrays:
        maps = {name: name for name in self._table.uv_maps(slots)}
        if LIGHTMAP_UVS in maps:
            maps[LIGHTMAP_UVS] = layer
        return read_mesh(mesh, None if atlas is None or layer not in mesh.uv_layers else layer, maps)


def _shape(corners: Corners, slots: Sequence[int], uvs: np.ndarray | None) -> SharedMesh | str:
    """Return a mesh with its materials, or a sentence with the problem that excludes it.

    uvs:  (l, 2) float32, its lightmap UVs; None without any
    """
    if not len(corners.positions):
        return NO_FACES
    if not np.isfinite(corners.positions).all():
        return NOT_FINITE
    if not np.isfinite(corners.normals).all():
        return NORMALS_NOT_FINITE
    index = np.clip(corners.slot, 0, len(slots) - 1)
    digest = "" if uvs is None else digest_of(uvs)
    return SharedMesh(corners, np.asarray(slots, np.int32)[index], _box(corners.positions), digest)


def _uv_issue(uvs: np.ndarray | None) -> str | None:
    """Return the problem of lightmap UVs that are missing or not finite; None if there is none."""
    if uvs is None:
        return NO_UVS
    return None if is_finite(uvs) else NOT_FINITE_UVS


def _box(positions: np.ndarray) -> np.ndarray:
    """Return the corners of the bounding box of triangles, (8, 3) float64."""
    bounds = np.stack([positions.min(axis=(0, 1)), positions.max(axis=(0, 1))]).astype(np.float64)
    return np.stack(np.meshgrid(*bounds.T, indexing="ij"), axis=-1).reshape(8, 3)


def _objects(names: Sequence[str]) -> str:
    """Return the subject of a sentence for `object_message`: "Object" or "Objects", and {}."""
    return "Object {}" if len(names) == 1 else "Objects {}"
