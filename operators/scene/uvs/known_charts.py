"""Recovers the charts of an existing lightmap UV layer, so that repacking keeps their shapes."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ....engine.unwrap.adjacency import components
from ....engine.unwrap.polygon_mesh import MeshCharts, PolygonMesh, areas, signed_areas
from ..objects.meshes import read_uvs
from .uv_digest import digest_of
from .uv_faults import is_finite

#: UVs of neighbouring polygons count as equal if they round to the same multiple of 1 / _STEPS.
_STEPS = 1 << 20


def is_made(objects: Sequence[bpy.types.Object], layer: str) -> bool:
    """Return True if the UV layer is as Hemibake made it, for all objects that use one mesh."""
    mesh = objects[0].data
    if layer not in mesh.uv_layers:
        return False
    digest = digest_of(read_uvs(mesh.uv_layers[layer]))
    return all(obj.hemibake.generated_uvs == digest for obj in objects)


def has_chosen_uvs(obj: bpy.types.Object) -> bool:
    """Return True if an object has a UV layer of its own whose UVs are not as Hemibake made them."""
    layer = obj.hemibake.own_uv_layer
    return layer in obj.data.uv_layers and not is_made([obj], layer)


def known_charts(mesh: PolygonMesh, uvs: np.ndarray) -> MeshCharts | None:
    """Return the charts of a UV layer, (l, 2) float32; None if a chart has no UV area, or UVs are not finite.

    Polygons that share a vertex and its UV belong to one chart (connected components). Each chart is scaled
    such that its UV area equals its surface area.
    """
    if not is_finite(uvs) or not len(mesh.triangles):
        return None
    steps = np.round(uvs.astype(np.float64) * _STEPS).astype(np.int64)
    _, place = np.unique(np.c_[mesh.corners, steps], axis=0, return_inverse=True)
    polygons = len(mesh.starts) - 1
    of_loop = np.repeat(np.arange(polygons), np.diff(mesh.starts))

    # Join all polygons that share a vertex and its UV with the first of them.
    place = place.reshape(-1)
    first = np.full(place.max(initial=-1) + 1, polygons)
    np.minimum.at(first, place, of_loop)
    chart = components(polygons, first[place], of_loop)

    count = chart.max(initial=-1) + 1
    of_triangle = chart[mesh.polygon]
    flat = np.abs(signed_areas(uvs[mesh.triangles].astype(np.float64)))
    space = areas(mesh.positions[mesh.corners[mesh.triangles]])
    flat, space = (np.bincount(of_triangle, values, count) for values in (flat, space))
    if ((flat <= 0) & (space > 0)).any():
        return None
    scale = np.sqrt(space / np.where(flat > 0, flat, np.inf))
    return MeshCharts(uvs * scale[chart][of_loop][:, None], np.where(space[of_triangle] > 0, of_triangle, -1))
