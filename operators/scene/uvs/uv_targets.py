"""Meshes that lack lightmap UVs: objects' own ones, and those that their modifiers make of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np

from ....engine.scene.degenerate import is_degenerate
from ....engine.unwrap.polygon_mesh import MeshCharts, PolygonMesh
from ..messages import LINKED, MANY_LAYERS, attribute_in_the_way
from ..objects.coordinate_limits import coordinate_issue
from ..objects.evaluation import Evaluation
from ..objects.meshes import read_array, read_corner_vertices, read_corners
from .lightmap_layer import lightmap_layer
from .uv_faults import cover, is_finite, is_inside, overlap
from .uv_layers import MOST_LAYERS
from .uv_modifier import has_uvs, topology, uv_modifier

#: Called with an object that gets no lightmap UVs, and why.
Leave = Callable[[bpy.types.Object, str], None]


@dataclass(frozen=True, eq=False)
class UnwrapMesh:
    """A mesh to unwrap.

    uids      session uids of all objects that show it
    atlas     name of the atlas that they belong to
    layer     its lightmap UV layer
    mesh      in world space, as the first of them shows it, times its scale in lightmaps
    area      its surface, m^2; 0 until it is measured
    topology  of a mesh that modifiers make; None for the objects' own mesh
    charts    once they are known
    """

    uids: tuple[int, ...]
    atlas: str
    layer: str
    mesh: PolygonMesh
    topology: str | None = None
    charts: MeshCharts | None = None
    area: float = 0.0


@contextmanager
def evaluated_mesh(obj: bpy.types.Object, evaluation: Evaluation) -> Iterator[bpy.types.Mesh | None]:
    """Give the mesh that an object's modifiers make; None if the evaluation does not have the object."""
    evaluated = evaluation.evaluated(obj)
    if not evaluated.is_evaluated:
        yield None
    elif obj.data.is_editmode:
        try:
            yield evaluated.to_mesh()
        finally:
            evaluated.to_mesh_clear()
    else:
        yield evaluated.data


@dataclass(frozen=True)
class Users:
    """Objects that show one mesh, which lacks a lightmap UV layer: their session uids, and the layer."""

    uids: tuple[int, ...]
    layer: str


def users_of_meshes(objects: Sequence[bpy.types.Object], uv_layer: str, anew: bool) -> list[Users]:
    """Return the users of each mesh that lacks the layer and can have one of its own.

    anew: those of meshes that have it, too
    """
    users: dict[tuple[int, str], list[int]] = {}
    for obj in objects:
        if obj.data.is_editable and (anew or not has_uvs(obj, uv_layer)):
            key = (obj.data.session_uid, lightmap_layer(obj, uv_layer))
            users.setdefault(key, []).append(obj.session_uid)
    return [Users(tuple(uids), layer) for (_, layer), uids in users.items()]


def own_target(objects: Sequence[bpy.types.Object], layer: str, leave: Leave) -> UnwrapMesh | None:
    """Return the mesh of objects that show one; None if it can have no layer."""
    mesh = _read(objects, objects[0].data, layer, leave)
    return None if mesh is None else UnwrapMesh(_uids(objects), objects[0].hemibake.atlas, layer, mesh)


def evaluated_targets(
    objects: Sequence[bpy.types.Object],
    uv_layer: str,
    made: set[int],
    evaluation: Evaluation,
    leave: Leave,
) -> list[UnwrapMesh]:
    """Return the meshes that modifiers make such that the layer is missing or of no use.

    objects: see `may_lack_uvs`

    made: session uids of the meshes whose layer has just been made. A layer of the user's that is of no
    use before any modifier stays as it is.
    """
    users: dict[tuple[int, str, str, str], list[bpy.types.Object]] = {}
    meshes: dict[tuple[int, str, str, str], PolygonMesh | None] = {}
    for obj in objects:
        layer = lightmap_layer(obj, uv_layer)
        with evaluated_mesh(obj, evaluation) as mesh:
            if mesh is None or not _lacks_uvs(obj, mesh, layer, made):
                continue
            if not obj.is_editable:
                leave(obj, LINKED)
                continue
            key = (obj.data.session_uid, layer, obj.hemibake.atlas, topology(mesh))
            if key not in meshes:
                meshes[key] = _read([obj], mesh, layer, leave)
            users.setdefault(key, []).append(obj)
    return [
        UnwrapMesh(_uids(users[key]), key[2], key[1], mesh, key[3])
        for key, mesh in meshes.items()
        if mesh is not None
    ]


def may_lack_uvs(obj: bpy.types.Object, uv_layer: str) -> bool:
    """Return True if what an object's modifiers make may lack the layer."""
    return len(obj.modifiers) > 0 or lightmap_layer(obj, uv_layer) not in obj.data.uv_layers


def _uids(objects: Sequence[bpy.types.Object]) -> tuple[int, ...]:
    return tuple(obj.session_uid for obj in objects)


def _lacks_uvs(obj: bpy.types.Object, mesh: bpy.types.Mesh, uv_layer: str, made: set[int]) -> bool:
    """Return whether an object's evaluated mesh needs UVs that its own mesh cannot have."""
    if not len(mesh.polygons) or uv_modifier(obj, uv_layer):
        return False
    if uv_layer not in mesh.uv_layers:
        return True
    if len(mesh.polygons) == len(obj.data.polygons) and len(mesh.loops) == len(obj.data.loops):
        return False
    if is_usable_layer(mesh, uv_layer):
        return False
    return obj.data.session_uid in made or obj.data.is_editmode or is_usable_layer(obj.data, uv_layer)


def is_usable_layer(mesh: bpy.types.Mesh, uv_layer: str) -> bool:
    """Return whether a layer gives each part of a mesh a place of its own."""
    corners = read_corners(mesh, uv_layer, {})
    if not is_finite(corners.uvs) or not is_inside(corners.uvs):
        return False
    return not overlap(corners.uvs) and cover(corners.uvs, corners.positions)


def _read(
    objects: Sequence[bpy.types.Object], mesh: bpy.types.Mesh, uv_layer: str, leave: Leave
) -> PolygonMesh | None:
    """Return the mesh of objects, in world space as the first has it; None if it cannot have the layer."""
    if not len(mesh.polygons):
        return None
    positions = _world_positions(objects[0], mesh)
    trouble = _trouble(mesh, positions, uv_layer)
    if trouble:
        for obj in objects:
            leave(obj, trouble)
        return None
    mesh.calc_loop_triangles()
    starts = np.r_[read_array(mesh.polygons, "loop_start", 1, np.int32)[:, 0], len(mesh.loops)]
    corners = read_corner_vertices(mesh)
    triangles = read_array(mesh.loop_triangles, "loops", 3, np.int32)
    stored = read_array(mesh.vertices, "co", 3, np.float32)[corners[triangles]]
    return PolygonMesh(
        name=objects[0].name,
        positions=positions * objects[0].hemibake.lightmap_scale,
        corners=corners,
        starts=starts,
        triangles=triangles,
        polygon=np.repeat(np.arange(len(starts) - 1, dtype=np.int32), np.maximum(np.diff(starts) - 2, 0)),
        degenerate=np.flatnonzero(is_degenerate(stored)),
    )


def _trouble(mesh: bpy.types.Mesh, positions: np.ndarray, uv_layer: str) -> str | None:
    """Return why a mesh, at these positions in world space, cannot have the layer."""
    if len(mesh.uv_layers) >= MOST_LAYERS and uv_layer not in mesh.uv_layers:
        return MANY_LAYERS
    if uv_layer in mesh.attributes and uv_layer not in mesh.uv_layers:
        return attribute_in_the_way(uv_layer)
    return coordinate_issue(positions)


def _world_positions(obj: bpy.types.Object, mesh: bpy.types.Mesh) -> np.ndarray:
    """Return the vertices in world space, (v, 3) float64."""
    matrix = np.array(obj.matrix_world, np.float64)
    positions = read_array(mesh.vertices, "co", 3, np.float32).astype(np.float64)
    with np.errstate(invalid="ignore", over="ignore"):
        return positions @ matrix[:3, :3].T + matrix[:3, 3]
