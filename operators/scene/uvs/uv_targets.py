"""Search for meshes without usable lightmap UVs: objects' own meshes, and evaluated meshes."""

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

#: Callback for an object that gets no lightmap UVs, with the reason.
Leave = Callable[[bpy.types.Object, str], None]


@dataclass(frozen=True, eq=False)
class UnwrapMesh:
    """A mesh to unwrap.

    uids:      session uids of all objects that use it
    atlas:     name of the atlas of these objects
    layer:     name of its lightmap UV layer
    mesh:      the mesh in the world space of the first object, scaled by that object's lightmap scale
    area:      surface area, m^2; 0 until it is measured
    topology:  digest of the topology of an evaluated mesh; None for the objects' own mesh
    charts:    its charts; None until they are known
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
    """Provide the evaluated mesh of an object; None if the dependency graph does not evaluate the object."""
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
    """Session uids of the objects that use one mesh, and the lightmap UV layer that the mesh lacks."""

    uids: tuple[int, ...]
    layer: str


def users_of_meshes(objects: Sequence[bpy.types.Object], uv_layer: str, every: bool) -> list[Users]:
    """Return the users of each editable mesh that lacks its lightmap UV layer.

    every:  True to include meshes that already have the layer
    """
    users: dict[tuple[int, str], list[int]] = {}
    for obj in objects:
        if obj.data.is_editable and (every or not has_uvs(obj, uv_layer)):
            key = (obj.data.session_uid, lightmap_layer(obj, uv_layer))
            users.setdefault(key, []).append(obj.session_uid)
    return [Users(tuple(uids), layer) for (_, layer), uids in users.items()]


def own_target(objects: Sequence[bpy.types.Object], layer: str, leave: Leave) -> UnwrapMesh | None:
    """Return the own mesh of objects that share it, in world space; None if it cannot have a UV layer."""
    mesh = _read(objects, objects[0].data, layer, leave)
    return None if mesh is None else UnwrapMesh(_uids(objects), objects[0].hemibake.atlas, layer, mesh)


def evaluated_targets(
    objects: Sequence[bpy.types.Object], uv_layer: str, made: set[int], evaluation: Evaluation, leave: Leave
) -> list[UnwrapMesh]:
    """Return the evaluated meshes whose lightmap UV layer is missing or unusable because of modifiers.

    objects:  objects for which `may_lack_uvs` is True
    made:     session uids of meshes whose layer was just made. A user's layer that is unusable even without
              modifiers is left as it is.
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
    """Return True if the evaluated mesh of an object may lack the lightmap UV layer."""
    return len(obj.modifiers) > 0 or lightmap_layer(obj, uv_layer) not in obj.data.uv_layers


def _uids(objects: Sequence[bpy.types.Object]) -> tuple[int, ...]:
    return tuple(obj.session_uid for obj in objects)


def _lacks_uvs(obj: bpy.types.Object, mesh: bpy.types.Mesh, uv_layer: str, made: set[int]) -> bool:
    """Return True if modifiers leave an evaluated mesh without usable UVs, so that it needs its own."""
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
    """Return True if UVs are finite, within 0-1, without overlaps, and cover nearly all of the surface."""
    corners = read_corners(mesh, uv_layer, {})
    assert corners.uvs is not None
    if not is_finite(corners.uvs) or not is_inside(corners.uvs):
        return False
    return not overlap(corners.uvs) and cover(corners.uvs, corners.positions)


def _read(
    objects: Sequence[bpy.types.Object], mesh: bpy.types.Mesh, uv_layer: str, leave: Leave
) -> PolygonMesh | None:
    """Return a mesh in the first object's world space; None without faces or if it cannot have the layer."""
    if not len(mesh.polygons):
        return None
    positions = _world_positions(objects[0], mesh)
    issue = _issue(mesh, positions, uv_layer)
    if issue:
        for obj in objects:
            leave(obj, issue)
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


def _issue(mesh: bpy.types.Mesh, positions: np.ndarray, uv_layer: str) -> str | None:
    """Return why a mesh with these world-space positions cannot have the layer; None if it can."""
    if len(mesh.uv_layers) >= MOST_LAYERS and uv_layer not in mesh.uv_layers:
        return MANY_LAYERS
    if uv_layer in mesh.attributes and uv_layer not in mesh.uv_layers:
        return attribute_in_the_way(uv_layer)
    return coordinate_issue(positions)


def _world_positions(obj: bpy.types.Object, mesh: bpy.types.Mesh) -> np.ndarray:
    """Return the vertex positions in world space, (v, 3) float64."""
    matrix = np.array(obj.matrix_world, np.float64)
    positions = read_array(mesh.vertices, "co", 3, np.float32).astype(np.float64)
    with np.errstate(invalid="ignore", over="ignore"):
        return positions @ matrix[:3, :3].T + matrix[:3, 3]
