"""From a lightmap texel to its patch, also where no texel centre is covered.

A look-up by lightmap UV can land on a texel that a triangle touches without covering its centre.
Such a texel belongs to a patch nearby on the same surface, so that no light is lost at chart
borders; the radiosity itself is never dilated during iterations (paper, VI.B). A surface too thin
to cover any centre nearby gets a patch of its own.
"""

from __future__ import annotations

import numpy as np

from ..device.compute import Compute
from .border_texels import BorderTexels, DeviceBorder
from .geometry import PatchGeometry
from .host_border_texels import HostBorder
from .patch_list import PatchList


def add_thin_patches(
    compute: Compute | None,
    geometry: PatchGeometry,
    patches: PatchList,
    texel_to_patch: np.ndarray,
    border: BorderTexels,
) -> tuple[PatchList, PatchGeometry, np.ndarray]:
    """Give every touched texel a patch; return the grown patch list, its geometry and the whole index map.

    texel_to_patch  that of `PatchList.on_texels`, which is changed
    border          all other texels that a triangle touches
    """
    if not len(border):
        return patches, geometry, texel_to_patch
    texels = DeviceBorder(compute, geometry, border) if compute else HostBorder(geometry, border)
    nearest, inside = texels.nearest_patches(patches, texel_to_patch)

    # Surfaces without a covered centre nearby become patches in the middle of what the texel shows of them:
    # a point on their edge would see past the surfaces that meet them there.
    thin = np.flatnonzero((nearest == 0) & inside)
    if len(thin):
        middle = texels.middles(thin, patches.resolution)
        patches = _with_thin(patches, border.part(thin), middle)
        geometry = geometry.at(patches)
        texel_to_patch = patches.on_texels(len(texel_to_patch))
        own = texel_to_patch.ravel()[border.texel[thin]]
        nearest, _ = texels.nearest_patches(patches, texel_to_patch)
        nearest[thin] = own
    texel_to_patch.ravel()[border.texel] = nearest
    return patches, geometry, texel_to_patch


def _with_thin(patches: PatchList, thin: BorderTexels, middle: np.ndarray) -> PatchList:
    """Return patches, and those on thin surfaces with barycentrics (k, 3), by atlas and texel."""
    place = np.searchsorted(patches.key, thin.texel)
    atlas, texel = np.divmod(thin.texel, patches.resolution**2)
    return PatchList(
        patches.resolution,
        np.insert(patches.atlas, place, atlas),
        np.insert(patches.texel, place, texel),
        np.insert(patches.triangle, place, thin.triangle),
        np.insert(patches.barycentric, place, middle, axis=0),
    )
