"""Filter for UV seams that geometry blocks: both sides keep their own light.

A wall that stands on a seam separates the light of its two sides, so the fit must not make them equal.
"""

from __future__ import annotations

import numpy as np

from ..array_ops import all_in_rows
from ..device.buffers import download_bytes, upload, upload_once, words_of, zeros
from ..device.cl_device import ComputeDevice
from ..patches.patch_scene import PatchScene
from ..patches.seams import Seams
from ..visibility.rays.ray_scene import RayScene
from .bilinear import footprints
from .device_images import DeviceTexels
from .lightmap_points import SOURCE

#: Relative difference of irradiance above which the two sides of a seam have different light (chosen).
_DIFFERS = 0.25

#: Height of the visibility rays above the surface, as a fraction of the distance between the two patches
#: (chosen).
_ABOVE = 0.1

#: Cosines between normals. A seam is tested where its two sides are nearly coplanar (above the first value).
#: A blocker counts if it is steep against the surface (below the second value).
_EVEN, _STEEP = 0.9, 0.7

#: Bit flag of seams, as in kernels/postprocess/seam_lookups.cl.
_OTHER_LIGHT = 1


def drop_blocked_seams(
    seams: Seams,
    patch_scene: PatchScene,
    ray_scene: RayScene,
    light: DeviceTexels,
    known: np.ndarray,
    invalid: np.ndarray,
) -> Seams:
    """Return the seams that no geometry blocks.

    A seam is blocked if a steep face lies between the patches on its two sides. It is also blocked if both
    patches are invalid and the light differs or is unknown.

    seams:        pairs of points on both sides of seams
    patch_scene:  patches of the scene that `ray_scene` traces
    ray_scene:    ray tracer of the scene
    light:        irradiance of each texel, sum of the channels
    known:        (atlases, r, r) bool, texels with valid light; must not be changed, since its upload is
                  cached
    invalid:      (m,) bool, invalid patches of the user's lightmaps
    """
    if not len(seams):
        return seams
    entries = patch_scene.patches.on_texels(len(known))
    marks = _compared(ray_scene.compute, seams, light, known, entries)
    some = np.flatnonzero(marks > 0)
    patches = _patches_beside(seams.subset(some), entries, known)
    both = all_in_rows(patches >= 0)
    some, patches = some[both], patches[both]

    # Both patches are invalid, so the difference of light comes from the geometry that covers them.
    stands = (marks[some] & _OTHER_LIGHT > 0) & all_in_rows(invalid[patches])
    blocked = some[stands | _something_between(patch_scene, ray_scene, patches)]
    if not len(blocked):
        return seams
    kept = np.ones(len(seams), bool)
    kept[blocked] = False
    return seams.subset(kept)


def _compared(
    compute: ComputeDevice, seams: Seams, light: DeviceTexels, known: np.ndarray, entries: np.ndarray
) -> np.ndarray:
    """Return the flags of seams, (p,) uint8, from the irradiance of texels.

    known, entries:  see `drop_blocked_seams` and `_patches_beside`; their uploads are cached
    """
    (kernel,) = compute.kernels(SOURCE, "compare_sides")
    found = zeros(compute, words_of(len(seams)))
    sides = seams.texel.astype(np.float32), seams.atlas.astype(np.int32, copy=False)
    texels = light.buffer, *(upload_once(compute, array) for array in (known, entries))
    size = np.int32(known.shape[-1]), np.int32(len(seams))
    buffers = *(upload(compute, array) for array in sides), *texels
    compute.run(kernel, len(seams), *buffers, np.float32(_DIFFERS), found, *size)
    return download_bytes(compute, found, len(seams))


def _patches_beside(seams: Seams, entries: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return the patch of the texel with the largest lookup weight on each side, (p, 2) int32; -1 for none.

    entries:  (atlases, r, r) uint32, the patch + 1 of each texel; 0 for none
    known:    (atlases, r, r) bool, texels with valid light, which are preferred
    """
    patches = np.empty((len(seams), 2), np.int32)
    for side in (0, 1):
        texels, weights = footprints(seams.atlas[:, side], seams.texel[:, side], known.shape[-1])
        found = entries.ravel()[texels].astype(np.int32) - 1
        rank = np.where((found >= 0) & (weights > 0), weights + known.ravel()[texels], -1)
        most = np.arange(len(seams)), rank.argmax(axis=1)
        patches[:, side] = np.where(rank[most] > 0, found[most], -1)
    return patches


def _something_between(patch_scene: PatchScene, ray_scene: RayScene, patches: np.ndarray) -> np.ndarray:
    """Return a mask, (m,) bool: True if the ray between two patches, (m, 2) int32, hits a steep face."""
    if not len(patches):
        return np.zeros(0, bool)
    ends = [patch_scene.geometry.subset(patches[:, side]) for side in (0, 1)]
    distance = np.linalg.norm(ends[1].center - ends[0].center, axis=1)[:, None]
    first, second = (end.center + _ABOVE * distance * end.geometric for end in ends)
    up = ends[0].geometric + ends[1].geometric
    up /= np.maximum(np.linalg.norm(up, axis=1)[:, None], 1e-20)
    even = (ends[0].geometric * ends[1].geometric).sum(axis=1) > _EVEN
    stands = np.zeros(len(patches), bool)
    for start, end in ((first, second), (second, first)):
        triangle, _, far = ray_scene.rays.cast(start, end - start)
        met = even & (triangle >= 0) & (far <= 1)
        normals = patch_scene.geometry.steps.geometric[np.maximum(triangle, 0)]
        stands |= met & (np.abs((normals * up).sum(axis=1)) < _STEEP)
    return stands
