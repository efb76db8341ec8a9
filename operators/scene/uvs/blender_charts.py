"""Cuts meshes into charts by Blender's Smart UV Project operator, for machines without xatlas.

The operator runs on a temporary mesh in a temporary scene. Nothing in the user's scene is selected or edited,
and both are removed afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import radians

import bpy
import numpy as np

from ....engine.unwrap.polygon_mesh import PolygonMesh, areas, signed_areas
from ...compat import remove_scene
from ..objects.meshes import read_array, read_uvs
from .uv_faults import covered_texels

#: Angle limit of Smart UV Project: largest angle between a face normal and the projection direction of its
#: chart, radians.
_ANGLE = radians(66)

#: Gap between islands as a fraction of the map. Without a gap, islands may touch in a vertex and count as one
#: (Blender 5.3).
_MARGIN = 1 / 256

#: Minimum ratio of UV area to surface area; triangles below it are dropped from their chart. They arise at
#: grazing angles.
_LEAST_PART = 0.3

#: Width and height, in cells, of the grid on which a chart is rasterized to find overlapping triangles.
_GRID = 512

#: A chart counts as planar if the cosine between each triangle normal and the mean normal is at least this.
_FLAT = 0.9999

_NAME = ".Hemibake UVs"


def segment(mesh: PolygonMesh) -> tuple[np.ndarray, np.ndarray]:
    """Cut a mesh by Smart UV Project; return corner UVs, (t, 3, 2) float64 in metres, and charts, (t,) int64.

    The chart of a triangle is -1 if the projection turned it over or shrank it too much. All triangles of a
    chart that overlaps itself are -1 as well.
    """
    centre = (mesh.positions.min(axis=0) + mesh.positions.max(axis=0)) / 2
    uvs = _edited_uvs(mesh.positions - centre, mesh.corners, mesh.starts, _project)
    if uvs is None:
        return np.zeros((len(mesh.triangles), 3, 2)), np.full(len(mesh.triangles), -1)
    chart = _islands(mesh, uvs)[mesh.polygon]
    return _checked(mesh, uvs[mesh.triangles].astype(np.float64), chart)


def _project() -> None:
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.uv.smart_project(angle_limit=_ANGLE, margin_method="FRACTION", island_margin=_MARGIN)


def _edited_uvs(
    positions: np.ndarray, corners: np.ndarray, starts: np.ndarray, edit: Callable[[], None]
) -> np.ndarray | None:
    """Return the loops' UVs, (l, 2) float32, after `edit` ran in edit mode; None if faces were dropped.

    positions:  (v, 3) float64, vertex positions
    corners:    (l,) integers, vertex of each loop
    starts:     (p + 1,) integers, first loop of each polygon, as in `PolygonMesh`
    """
    size = np.ptp(positions, axis=0).max(initial=1e-30)
    mesh = bpy.data.meshes.new(_NAME)
    try:
        mesh.vertices.add(len(positions))
        mesh.vertices.foreach_set("co", (positions / size).astype(np.float32).reshape(-1))
        mesh.loops.add(len(corners))
        mesh.loops.foreach_set("vertex_index", corners.astype(np.int32))
        mesh.polygons.add(len(starts) - 1)
        mesh.polygons.foreach_set("loop_start", starts[:-1].astype(np.int32))
        mesh.update(calc_edges=True)
        mesh.uv_layers.new(name="UVMap")
        with _edit_mode(mesh):
            edit()
        if not np.array_equal(read_array(mesh.loops, "vertex_index", 1, np.int32)[:, 0], corners):
            return None
        return read_uvs(mesh.uv_layers[0])
    finally:
        bpy.data.meshes.remove(mesh)


@contextmanager
def _edit_mode(mesh: bpy.types.Mesh) -> Iterator[None]:
    """Enter edit mode on a mesh in a temporary scene, so that operators act on that mesh."""
    scene, obj = bpy.data.scenes.new(_NAME), bpy.data.objects.new(_NAME, mesh)
    try:
        scene.collection.objects.link(obj)
        layer = scene.view_layers[0]
        layer.objects.active = obj
        context = {"scene": scene, "view_layer": layer, "active_object": obj, "object": obj}
        with bpy.context.temp_override(**context, edit_object=None):
            bpy.ops.object.mode_set(mode="EDIT")
        with bpy.context.temp_override(**context, edit_object=obj):
            yield
            bpy.ops.object.mode_set(mode="OBJECT")
    finally:
        bpy.data.objects.remove(obj)
        remove_scene(scene)


def _islands(mesh: PolygonMesh, uvs: np.ndarray) -> np.ndarray:
    """Return the UV island of each polygon, (p,) int64: polygons that share a vertex and its UV are joined.

    Connected components by label propagation: each polygon takes the smallest label of its neighbours.
    Pointer jumping shortens chains of labels in each round. It ends when no label changes.
    """
    places = np.c_[mesh.corners, np.ascontiguousarray(uvs, np.float32).view(np.int32)]
    _, place = np.unique(places, axis=0, return_inverse=True)
    place, polygons = place.reshape(-1), len(mesh.starts) - 1
    of_loop = np.repeat(np.arange(polygons), np.diff(mesh.starts))
    island = np.arange(polygons)
    while True:
        least = np.full(place.max(initial=-1) + 1, polygons)
        np.minimum.at(least, place, island[of_loop])
        joined = np.minimum(island, np.minimum.reduceat(least[place], mesh.starts[:-1]))
        joined = joined[joined]
        if np.array_equal(joined, island):
            return np.unique(island, return_inverse=True)[1].reshape(-1)
        island = joined


def _checked(mesh: PolygonMesh, uvs: np.ndarray, chart: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return charts' UVs scaled to metres, and the chart of each triangle, with -1 for unusable triangles."""
    corners = mesh.positions[mesh.corners[mesh.triangles]]
    space, flat, charts = areas(corners), signed_areas(uvs), chart.max(initial=-1) + 1
    total = [np.bincount(chart, values, charts) for values in (space, flat, np.abs(flat))]
    uvs = uvs * np.sqrt(total[0] / np.maximum(total[2], 1e-30))[chart][:, None, None]

    # A triangle that is turned over overlaps its neighbour. A chart with negative signed area is mirrored as
    # a whole and still usable.
    lost = signed_areas(uvs) * np.sign(total[1])[chart] < _LEAST_PART * space
    for bent in _bent_charts(corners, chart):
        members = (chart == bent) & ~lost
        if _overlap(uvs[members]):
            lost |= members
    return uvs, np.where(lost, -1, chart)


def _overlap(uvs: np.ndarray) -> bool:
    """Return True if two triangles, (t, 3, 2) UVs, cover the centre of the same grid cell."""
    points = uvs.reshape(-1, 2)
    low = points.min(axis=0, initial=np.inf)
    size = float((points - low).max(initial=0.0))
    return size > 0 and bool((covered_texels((uvs - low) / size, _GRID)[1] > 1).any())


def _bent_charts(corners: np.ndarray, chart: np.ndarray) -> np.ndarray:
    """Return the non-planar charts, (k,) int64, which may overlap themselves; `corners` is (t, 3, 3)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.stack([np.bincount(chart, values) for values in normal.T], axis=1)
    mean = sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-30)
    cosine = (normal * mean[chart]).sum(axis=1)
    return np.unique(chart[cosine < _FLAT * np.linalg.norm(normal, axis=1)])
