"""Surface area that each patch represents."""

from __future__ import annotations

import numpy as np

from ..array_ops import map_blocks, run_starts
from ..scene.triangles import Triangles
from .back_areas import back_areas
from .geometry import PatchGeometry
from .patch_list import PatchList
from .texel_components import connected_texels

#: Keys are numbered by a lookup table if the largest key is less than this multiple of the number of keys,
#: else by a sort.
_SPARSE = 4


def surface_areas(triangles: Triangles, patches: PatchList, geometry: PatchGeometry) -> np.ndarray:
    """Return the surface area that each patch represents, (n,) float32, m^2.

    The texel area is multiplied by a factor per chart, so that the patches of a chart together have the area
    of its triangles, although chart borders cut texels. The area of triangles without a patch is distributed
    over all patches of their mesh and material. Back faces have exact areas, see `back_areas`.
    """
    kinds = int(triangles.material.max(initial=0)) + 1
    surface = triangles.mesh.astype(np.int64) * kinds + triangles.material
    part, listed = _parts_of_charts(surface, patches, geometry)

    # All texels of a triangle have one size. Compare the triangle's area with the area of its texels that are
    # patches.
    whole = _triangle_areas(triangles, patches.resolution, geometry)
    texel = geometry.steps.area[listed].astype(np.float64)
    scale = _ratios(part, whole[listed], texel * geometry.on_triangle[listed])
    left_out = (
        np.bincount(surface, whole),
        np.bincount(surface[listed], whole[listed], surface.max(initial=0) + 1),
    )
    more = np.divide(*left_out, out=np.ones_like(left_out[0]), where=left_out[1] > 0)
    areas = np.zeros(len(surface), np.float32)
    areas[listed] = np.minimum(texel * more[surface[listed]] * scale, np.finfo(np.float32).max)
    area: np.ndarray = areas[geometry.triangle]
    if triangles.backs is not None:
        chosen, exact = back_areas(triangles, triangles.backs, patches, geometry)
        area[chosen] = exact
    return area


def _triangle_areas(triangles: Triangles, resolution: int, geometry: PatchGeometry) -> np.ndarray:
    """Return the area of each triangle by its texel area and UVs, (t,) float64, m^2."""
    whole = np.empty(len(triangles.uvs))

    def measure(block: slice) -> None:
        uvs = triangles.uvs[block]
        (u1, v1), (u2, v2) = ((uvs[:, k] - uvs[:, 0]).T * resolution for k in (1, 2))
        texel = geometry.steps.area[block].astype(np.float64)
        whole[block] = texel * np.abs(u1 * v2 - u2 * v1) / 2

    map_blocks(len(whole), 40, measure)
    return whole


def _parts_of_charts(
    surface: np.ndarray, patches: PatchList, geometry: PatchGeometry
) -> tuple[np.ndarray, np.ndarray]:
    """Return the chart part of each triangle that has patches: triangles of one chart and one surface.

    surface: (t,) int64, number of the mesh and material of each triangle
    Returns (k,) int64, number of the part, and (k,) int64, indices of the triangles, ascending.
    """
    shape = int(patches.atlas.max(initial=0)) + 1, patches.resolution, patches.resolution
    known = np.zeros(shape, bool)
    known.ravel()[patches.key] = True
    chart = connected_texels(known)

    # Any patch of a triangle tells its chart.
    some = np.full(len(surface), -1)
    last = np.append(run_starts(geometry.triangle)[1:], len(patches)) - 1
    some[geometry.triangle[last]] = last
    listed = np.flatnonzero(some >= 0)
    key = surface[listed] * (int(chart.max(initial=0)) + 1) + chart[some[listed]]
    return _numbered(key), listed


def _numbered(keys: np.ndarray) -> np.ndarray:
    """Replace keys, (k,) int64 >= 0, by consecutive numbers in ascending order of the keys."""
    if keys.max(initial=0) > _SPARSE * len(keys):
        return np.unique(keys, return_inverse=True)[1].reshape(-1)
    there = np.zeros(keys.max(initial=0) + 1, bool)
    there[keys] = True
    numbers: np.ndarray = (np.cumsum(there) - 1)[keys]
    return numbers


def _ratios(part: np.ndarray, whole: np.ndarray, listed: np.ndarray) -> np.ndarray:
    """Return the ratio of the sums of two areas over each part, (k,) float64 by triangle.

    1 where the second sum is 0.
    """
    wholes, listings = np.bincount(part, whole), np.bincount(part, listed)
    return np.divide(wholes, listings, out=np.ones_like(wholes), where=listings > 0)[part]
