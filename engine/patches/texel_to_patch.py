"""Index map from lightmap texels to patches, including texels whose centre no triangle covers.

A lookup by lightmap UV may hit a texel that a triangle only touches. Such a texel takes a nearby patch of the
same surface, so that no light is lost at chart borders. Radiosity is never dilated during the iterations
(paper, VI.B). A surface too thin to cover any centre nearby gets its own patch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..array_ops import taken
from ..device.buffers import insert_rows_once
from ..device.cl_device import ComputeDevice
from .border_texels import BorderTexels, DeviceBorder
from .chart_texels import ChartTexels
from .geometry import PatchGeometry
from .host_border_texels import HostBorder
from .patch_list import PatchList


@dataclass(frozen=True)
class IndexMap:
    """Index map with the data to update it.

    patches:         all patches, including patches of thin surfaces
    texel_to_patch:  (atlases, r, r) uint32, patch + 1, or 0
    nearest:         (m,) uint32, nearest chart patch + 1 on the surface of each border texel, or 0
    inside:          (m,) bool, True if the surface reaches into the texel, beyond its border
    """

    patches: PatchList
    texel_to_patch: np.ndarray
    nearest: np.ndarray
    inside: np.ndarray


def index_map(
    compute: ComputeDevice | None, geometry: PatchGeometry, charts: ChartTexels, before: IndexMap | None
) -> IndexMap:
    """Assign a patch to each touched texel.

    compute:   OpenCL device; None to use the host
    geometry:  geometry of the chart patches
    charts:    chart coverage of the lightmaps
    before:    index map of the same charts before objects moved; returned unchanged if still valid
    """
    patches, border = charts.patches, charts.border
    if not len(border):
        none = np.zeros(0, np.uint32), np.zeros(0, bool)
        return before or IndexMap(patches, charts.entries, *none)
    texels = DeviceBorder(compute, geometry, border) if compute else HostBorder(geometry, border)
    nearest, inside = texels.nearest_patches(patches, charts.entries)
    found = nearest
    if before and np.array_equal(nearest, before.nearest) and np.array_equal(inside, before.inside):
        return before

    # Patches of thin surfaces lie at the centroid of the covered part. Rays from a point on an edge would
    # miss adjacent surfaces.
    entries = charts.entries
    thin = np.flatnonzero((nearest == 0) & inside)
    if len(thin):
        middle = texels.middles(thin, patches.resolution)
        patches = _with_thin(compute, patches, border.subset(thin), middle)
        entries = patches.on_texels(len(entries))
        nearest, _ = texels.nearest_patches(patches, entries)
        nearest[thin] = entries.ravel()[border.texel[thin]]
    texel_to_patch = entries.copy()
    texel_to_patch.ravel()[border.texel] = nearest
    return IndexMap(patches, texel_to_patch, found, inside)


def _with_thin(
    compute: ComputeDevice | None, patches: PatchList, thin: BorderTexels, middle: np.ndarray
) -> PatchList:
    """Return the patches merged with patches on thin surfaces, sorted by atlas and texel.

    The device copies of the patch arrays are updated too.

    compute:  OpenCL device; None on the host
    patches:  patches of the charts
    thin:     border texels of thin surfaces
    middle:   (k, 3) float32, barycentrics of the new patches
    """
    atlas, texel = np.divmod(thin.texel, patches.resolution**2)
    columns = (
        (patches.atlas, atlas), (patches.texel, texel), (patches.triangle, thin.triangle),
        (patches.barycentric, middle),
    )  # fmt: skip
    rows = np.searchsorted(patches.key, thin.texel) + np.arange(len(thin))
    order = np.arange(len(patches) + len(thin))
    order -= np.repeat(np.arange(len(thin) + 1), np.diff(rows, prepend=0, append=len(order)))
    every = PatchList(patches.resolution, *(_inserted(old, new, rows, order) for old, new in columns))
    if compute and len(patches):
        insert_rows_once(compute, patches.triangle, every.triangle, rows)
        insert_rows_once(compute, patches.barycentric, every.barycentric, rows)
    return every


def _inserted(old: np.ndarray, new: np.ndarray, rows: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Insert rows into a column of patches, (n, ...): return (n + k, ...) of its type.

    new:    (k, ...), rows to insert
    rows:   (k,) int64, ascending, their rows in the result
    order:  (n + k,) int64, the old row of each other row of the result
    """
    joined = taken(old, order) if len(old) else np.empty((len(order), *old.shape[1:]), old.dtype)
    joined[rows] = new
    return joined
