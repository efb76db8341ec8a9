"""Index map from lightmap texels to patches, including texels whose centre no triangle covers.

A lookup by lightmap UV may hit a texel that a triangle only touches. Such a texel takes a nearby patch of the
same surface, so that no light is lost at chart borders. Radiosity is never dilated during the iterations
(paper, VI.B). A surface too thin to cover any centre nearby gets its own patch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..array_ops import taken
from ..device.cl_device import ComputeDevice
from ..device.device_rows import Rows, host_rows
from .border_texels import BorderTexels
from .chart_texels import ChartTexels
from .device_border import DeviceBorder
from .geometry import PatchGeometry
from .host_border_texels import HostBorder
from .patch_list import PatchList


@dataclass(frozen=True)
class IndexMap:
    """Index map with the data to update it.

    patches:         all patches, including patches of thin surfaces
    texel_to_patch:  (atlases, r, r) uint32 on host or device, patch + 1, or 0
    nearest:         (m,) uint32 on host or device, nearest chart patch + 1 on the surface of each border
                     texel, or 0
    inside:          (m,) integers or bool, not 0 if the surface reaches into the texel, beyond its border
    on_triangle:     (t,) int32, number of patches on each triangle; None to compute it
    """

    patches: PatchList
    texel_to_patch: Rows
    nearest: Rows
    inside: Rows
    on_triangle: Rows | None = None

    def fits(self, nearest: Rows, inside: Rows) -> bool:
        """Return True if border texels have these nearest patches."""
        pairs = (nearest, self.nearest), (inside, self.inside)
        return all(np.array_equal(host_rows(new), host_rows(old)) for new, old in pairs)


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
        return before or IndexMap(patches, charts.entries, *none, charts.on_triangle)
    if compute:
        index = _index_on(DeviceBorder(compute, geometry, border), charts, before)
        if compute.processor:
            # Kernels on a CPU read arrays of the host in place, which may be freed from now on.
            compute.queue.finish()
        return index
    entries, texels = host_rows(charts.entries), HostBorder(geometry, border)
    nearest, inside = texels.nearest_patches(patches, entries)
    found = nearest
    if before and before.fits(nearest, inside):
        return before

    # Patches of thin surfaces lie at the centroid of the covered part. Rays from a point on an edge would
    # miss adjacent surfaces.
    counts: Rows | None = charts.on_triangle
    thin = np.flatnonzero((nearest == 0) & inside)
    if len(thin):
        counts = None
        patches = _with_thin(patches, border.subset(thin), texels.middles(thin, patches.resolution))
        entries = patches.on_texels(len(entries))
        nearest, _ = texels.nearest_patches(patches, entries)
        nearest[thin] = entries.ravel()[border.texel[thin]]
    texel_to_patch = entries.copy()
    texel_to_patch.ravel()[border.texel] = nearest
    return IndexMap(patches, texel_to_patch, found, inside, counts)


def _index_on(border: DeviceBorder, charts: ChartTexels, before: IndexMap | None) -> IndexMap:
    """Assign a patch to each touched texel as `index_map` does, on the OpenCL device."""
    patches, entries, counts = charts.patches, charts.entries, charts.on_triangle
    nearest, inside, thin = border.nearest_patches(patches, entries)
    if before and before.fits(nearest, inside):
        return before
    of_border, chosen = nearest, border.listed(thin)
    if len(chosen):
        patches, counts = border.with_thin(patches, entries, counts, chosen)
        entries = patches.index.entries_in(len(entries))
        of_border, *_ = border.nearest_patches(patches, entries)
    return IndexMap(patches, border.filled(entries, of_border), nearest, inside, counts)


def _with_thin(patches: PatchList, thin: BorderTexels, middle: np.ndarray) -> PatchList:
    """Return the patches merged with patches on thin surfaces, sorted by atlas and texel.

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
    return PatchList(patches.resolution, *(_inserted(old, new, rows, order) for old, new in columns))


def _inserted(old: np.ndarray, new: np.ndarray, rows: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Insert rows into a column of patches, (n, ...): return (n + k, ...) of its type.

    new:    (k, ...), rows to insert
    rows:   (k,) int64, ascending, their rows in the result
    order:  (n + k,) int64, the old row of each other row of the result
    """
    joined = taken(old, order) if len(old) else np.empty((len(order), *old.shape[1:]), old.dtype)
    joined[rows] = new
    return joined
