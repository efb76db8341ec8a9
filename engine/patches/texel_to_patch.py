"""From a lightmap texel to its patch, also where no texel centre is covered.

A look-up by lightmap UV can land on a texel that a triangle touches without covering its centre.
Such a texel belongs to a patch nearby on the same surface, so that no light is lost at chart
borders; the radiosity itself is never dilated during iterations (paper, VI.B). A surface too thin
to cover any centre nearby gets a patch of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.buffers import insert_rows_once
from ..device.cl_device import ComputeDevice
from ..threaded_slabs import taken
from .border_texels import BorderTexels, DeviceBorder
from .chart_texels import ChartTexels
from .geometry import PatchGeometry
from .host_border_texels import HostBorder
from .patch_list import PatchList


@dataclass(frozen=True)
class IndexMap:
    """Which patch each texel shows.

    patches         all of them, those on thin surfaces included
    texel_to_patch  (atlases, r, r) uint32: patch + 1, or 0
    nearest         (m,) uint32, the covered patch of the same surface that is nearest to each border texel
                    + 1, or 0
    inside          (m,) bool: more than a border of the surface is in the texel
    """

    patches: PatchList
    texel_to_patch: np.ndarray
    nearest: np.ndarray
    inside: np.ndarray


def index_map(
    compute: ComputeDevice | None, geometry: PatchGeometry, charts: ChartTexels, before: IndexMap | None
) -> IndexMap:
    """Give every touched texel a patch.

    geometry  of the charts' patches
    before    that of the same charts where they were: the same one is returned if nothing has changed
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

    # Surfaces without a covered centre nearby become patches in the middle of what the texel shows of them:
    # a point on their edge would see past the surfaces that meet them there.
    texel_to_patch = charts.entries.copy()
    thin = np.flatnonzero((nearest == 0) & inside)
    if len(thin):
        middle = texels.middles(thin, patches.resolution)
        patches = _with_thin(compute, patches, border.part(thin), middle)
        own = patches.on_texels(len(texel_to_patch))
        nearest, _ = texels.nearest_patches(patches, own)
        texel_to_patch, nearest[thin] = own.copy(), own.ravel()[border.texel[thin]]
    texel_to_patch.ravel()[border.texel] = nearest
    return IndexMap(patches, texel_to_patch, found, inside)


def _with_thin(
    compute: ComputeDevice | None, patches: PatchList, thin: BorderTexels, middle: np.ndarray
) -> PatchList:
    """Return patches, and those on thin surfaces with barycentrics (k, 3), by atlas and texel.

    A device that has the patches gets the others.
    """
    atlas, texel = np.divmod(thin.texel, patches.resolution**2)
    columns = (
        (patches.atlas, atlas), (patches.texel, texel), (patches.triangle, thin.triangle),
        (patches.barycentric, middle),
    )  # fmt: skip
    place = np.searchsorted(patches.key, thin.texel)
    order = _inserted(place, len(patches))
    joined = (np.concatenate([old, new.astype(old.dtype, copy=False)]) for old, new in columns)
    every = PatchList(patches.resolution, *(taken(column, order) for column in joined))
    if compute and len(patches):
        rows = place + np.arange(len(place))
        insert_rows_once(compute, patches.triangle, every.triangle, rows)
        insert_rows_once(compute, patches.barycentric, every.barycentric, rows)
    return every


def _inserted(place: np.ndarray, count: int) -> np.ndarray:
    """Return where `count` rows, then others, come from once the others are inserted, (count + k,) int64.

    place: (k,) int64, ascending: the row before which each of the others comes
    """
    others = place + np.arange(len(place))
    steps = np.ones(count + len(place), np.int64)
    steps[others] = 0
    order = np.cumsum(steps) - 1
    order[others] = np.arange(count, count + len(place))
    return order
