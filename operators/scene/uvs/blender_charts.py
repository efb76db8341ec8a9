"""Charts by Blender's own operators, for machines without xatlas.

They run on a mesh of their own in a scene of its own: nothing that the user sees is selected, edited or
left.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import radians

import bpy
import numpy as np

from ....engine.unwrap.polygon_mesh import PolygonMesh, areas, signed_areas
from ..objects.meshes import read_array, read_uvs
from .uv_faults import covered_texels

#: Largest angle between the faces of a chart and the direction along which they are projected.
_ANGLE = radians(66)

#: Least area of a triangle in its chart, relative to its part of it: at a grazing angle it gets less.
_LEAST_PART = 0.3

#: Texels along the wider side of a chart when it is looked for triangles that lie on each other.
_GRID = 512

#: Triangles are in one plane if the cosine between each and the mean normal is at least this.
_FLAT = 0.9999

_NAME = ".Hemibake UVs"


def segment(mesh: PolygonMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the UV of each triangle corner, (t, 3, 2) metres, and chart, (t,), -1 for none.

    Smart UV Project makes the charts; one that lies on itself, or is turned over in part, is none.
    """
    centre = (mesh.positions.min(axis=0) + mesh.positions.max(axis=0)) / 2
    uvs = _edited_uvs(mesh.positions - centre, mesh.corners, mesh.starts, _project)
    if uvs is None:
        return np.zeros((len(mesh.triangles), 3, 2)), np.full(len(mesh.triangles), -1)
    chart = _islands(mesh, uvs)[mesh.polygon]
    return _checked(mesh, uvs[mesh.triangles].astype(np.float64), chart)


def _project() -> None:
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.uv.smart_project(angle_limit=_ANGLE, margin_method="FRACTION", island_margin=0.0)


def _edited_uvs(
    positions: np.ndarray,
    corners: np.ndarray,
    starts: np.ndarray,
    edit: Callable[[], None],
) -> np.ndarray | None:
    """Return the UVs of the loops, (l, 2) float32, after an edit; None if Blender drops faces there.

    positions  (v, 3), vertices; corners (l,) and starts (p + 1,) as in `PolygonMesh`
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
    """Have operators work on a mesh in edit mode, in a scene of its own."""
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
        bpy.data.scenes.remove(scene)


def _islands(mesh: PolygonMesh, uvs: np.ndarray) -> np.ndarray:
    """Return the UV island of each polygon, (p,): neighbours have a corner with one vertex and UV in common.

    The least number of a neighbour spreads until nothing changes; numbers follow chains in each round.
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
    """Return the UVs of charts in metres, and the charts, -1 where they are of no use."""
    corners = mesh.positions[mesh.corners[mesh.triangles]]
    space, flat, charts = areas(corners), signed_areas(uvs), chart.max(initial=-1) + 1
    total = [np.bincount(chart, values, charts) for values in (space, flat, np.abs(flat))]
    uvs = uvs * np.sqrt(total[0] / np.maximum(total[2], 1e-30))[chart][:, None, None]

    # A triangle that is turned over lies on its neighbour; a chart that is all of these is mirrored.
    lost = signed_areas(uvs) * np.sign(total[1])[chart] < _LEAST_PART * space
    for bent in _bent_charts(corners, chart):
        members = (chart == bent) & ~lost
        if _overlap(uvs[members]):
            lost |= members
    return uvs, np.where(lost, -1, chart)


def _overlap(uvs: np.ndarray) -> bool:
    """Return whether the centre of a texel lies in several triangles, (t, 3, 2)."""
    points = uvs.reshape(-1, 2)
    low = points.min(axis=0, initial=np.inf)
    size = float((points - low).max(initial=0.0))
    return size > 0 and bool((covered_texels((uvs - low) / size, _GRID)[1] > 1).any())


def _bent_charts(corners: np.ndarray, chart: np.ndarray) -> np.ndarray:
    """Return the charts whose triangles, (t, 3, 3), are not all in one plane: they may lie on themselves."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    mean = np.stack([np.bincount(chart, values) for values in normal.T], axis=1)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-30)
    cosine = (normal * mean[chart]).sum(axis=1)
    return np.unique(chart[cosine < _FLAT * np.linalg.norm(normal, axis=1)])
