"""Patches that nobody sees, as they look to those who see the rest of their texels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..patches.subdivision import Subdivision
from ..scene.color import channel_sum
from ..segment_sums import segment_sums
from .display_points import DisplayJob
from .solve_job import SolveJob

#: Texels between a hidden patch and the visible ones that it may have light from, at most.
_REACH = 2

#: Light below this part of the brightest counts as that much in harmonic means.
_FAINTEST = 1e-4


def as_seen(what: DisplayJob, settled: np.ndarray, hidden: np.ndarray) -> np.ndarray:
    """Return E/pi, (m, 3 g) float32, of the patches that send light out, of hidden ones from beside them.

    settled  (m, 3 g) float32, E/pi of g groups of lights side by side; or reflectance
    hidden   (n,) bool, patches of the job that nobody sees
    """
    if not hidden.any():
        return settled
    if what.solved is what.job:
        return _seen_beside_hidden(what.job.parts, settled, hidden)
    patches, entries = what.job.parts.patches, what.solved.parts.texel_to_patch
    group = entries.reshape(len(entries), -1)[patches.atlas, patches.texel].astype(np.int64) - 1
    return _groups_beside_hidden(what.job.parts, group, settled, hidden)


def with_seen_surfaces(what: DisplayJob, solved: SolveJob, hidden: np.ndarray) -> SolveJob:
    """Return a job whose hidden patches, (n,) bool, reflect what those beside them do, as in `as_seen`."""
    surfaces = solved.parts.surfaces
    seen = replace(surfaces, reflectance=as_seen(what, surfaces.reflectance, hidden))
    return replace(solved, parts=replace(solved.parts, surfaces=seen))


def _groups_beside_hidden(
    parts: Subdivision, group: np.ndarray, light: np.ndarray, hidden: np.ndarray
) -> np.ndarray:
    """Return light of groups of patches, (m, 3 g) float32; that of groups with hidden patches is made anew.

    It becomes the mean over the group's visible patches and over its hidden ones near visible patches, which
    have the light beside them. Patches without light do not count: hidden ones farther off, which nobody
    sees, have none.

    group   (n,) int64, of each patch
    light   (m, 3 g) float32, E/pi
    hidden  (n,) bool
    """
    of_patches = _seen_beside_hidden(parts, light[group], hidden)
    changed = np.zeros(len(light), bool)
    changed[group[hidden]] = True
    seen = np.flatnonzero(changed[group])
    seen = seen[of_patches[seen].any(axis=1)]
    number = np.bincount(group[seen], minlength=len(light))[changed]
    sums = segment_sums(of_patches[seen], group[seen], len(light))[changed]
    result = light.copy()
    result[changed] = sums / np.maximum(number, 1)[:, None]
    return result


def _seen_beside_hidden(parts: Subdivision, light: np.ndarray, hidden: np.ndarray) -> np.ndarray:
    """Return light of patches, (n, 3 g) float32, in which hidden ones have that of patches beside them.

    A ray that meets the visible part of a texel whose centre is hidden has to find the light beside the
    centre. The harmonic mean of the patches there is taken: where a thin wall has light on one side and none
    on the other it is dark; a bright one would light the foot of the wall on its dark side. The g groups of
    lights are weighed by their sum.
    """
    filled, known, left = light.copy(), ~hidden, np.flatnonzero(hidden)
    total, beside = channel_sum(filled), _patches_beside(parts, left)
    for _ in range(_REACH):
        counts = (beside > 0) & known[beside - 1]
        reached = counts.any(axis=1)
        mine, near, counts = left[reached], beside[reached], counts[reached].astype(np.float32)
        sums = np.einsum("hk,hkc->hc", counts, filled[near - 1])
        filled[mine] = sums * _darkened(total, near, counts)[:, None]
        total[mine] = channel_sum(filled[mine])
        known[mine] = True
        left, beside = left[~reached], beside[~reached]
    filled[left] = 0
    return filled


def _darkened(total: np.ndarray, beside: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Return the factors, (h,) float32, that make harmonic means of sums of patches' light.

    total (n,) of all channels together; beside (h, k) int64, patch + 1; counts (h, k) float32, 1 for
    those that are added up, else 0
    """
    light, number = total[beside - 1], channel_sum(counts)
    bright = np.maximum(light, max(_FAINTEST * float(total.max()), 1e-30))
    inverse, sums = np.einsum("hk,hk->h", counts, 1 / bright), np.einsum("hk,hk->h", counts, light)
    factor: np.ndarray = np.minimum(number / np.maximum(inverse, 1e-30) / np.maximum(sums, 1e-30), 1 / number)
    return factor.astype(np.float32)


def _patches_beside(parts: Subdivision, patches: np.ndarray) -> np.ndarray:
    """Return patch + 1 in the 3 x 3 texels around some patches, (m, 9) int64, 0 for none."""
    resolution = parts.patches.resolution
    row, column = np.divmod(parts.patches.texel[patches], resolution)
    step = np.arange(9)
    y, x = row[:, None] + step // 3 - 1, column[:, None] + step % 3 - 1
    inside = (y >= 0) & (y < resolution) & (x >= 0) & (x < resolution)
    rows = parts.patches.atlas[patches, None].astype(np.int64) * resolution + y
    beside = parts.texel_to_patch.ravel().take(rows * resolution + x, mode="clip")
    return np.where(inside, beside, 0).astype(np.int64)
