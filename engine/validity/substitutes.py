"""Substitute patches: valid neighbours whose reflected light replaces the light of invalid patches.

Part of an invalid patch's texel may be visible; rays that hit it need plausible light. Iterations, final
gathers and probes take it from the same substitutes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..array_ops import nonzero_entries, taken
from ..patches.patch_scene import PatchScene
from ..patches.texels_around import beside_any, entries_around
from ..scene.color import channel_sum

#: Texels that are processed at once.
_TEXELS = 1 << 18

#: Patches for each invalid one from which the invalid ones count as few (chosen).
_FEW = 16

#: Minimum cosine between the normals of a patch and its substitute, and maximum distance between their
#: planes, texels.
_ALIKE, _NEAR = 0.9, 0.5

#: Fraction of the brightest light below which light counts as that bright in harmonic means.
_FAINTEST = 1e-4

#: Pairs of an invalid patch and a valid neighbour, two (p,) int64 arrays.
PatchPairs = tuple[np.ndarray, np.ndarray]


def find_substitutes(patch_scene: PatchScene, invalid: np.ndarray) -> PatchPairs:
    """Return pairs of invalid patches and valid ones in neighbouring texels on the same plane.

    invalid:  (n,) bool, invalid patches; at least one
    """
    texels = _invalid_texels(patch_scene, invalid)
    pairs = [
        _valid_neighbours(patch_scene, invalid, texels[first : first + _TEXELS])
        for first in range(0, max(len(texels), 1), _TEXELS)
    ]
    patch, neighbour = (np.concatenate(numbers) for numbers in zip(*pairs, strict=True))
    return patch, neighbour


def _invalid_texels(patch_scene: PatchScene, invalid: np.ndarray) -> np.ndarray:
    """Return texels of invalid patches, (k,) int64, ascending; may omit those without valid neighbours."""
    shown = patch_scene.texel_to_patch
    if np.count_nonzero(shown) == len(invalid) > _FEW * np.count_nonzero(invalid):
        # Each patch has one texel, and so few are invalid that all their neighbours are looked up.
        return patch_scene.patches.key[invalid]
    invalid_texels = taken(np.concatenate([[False], invalid]), shown.ravel()).reshape(shown.shape)
    texels: np.ndarray = np.flatnonzero(invalid_texels & beside_any((shown > 0) & ~invalid_texels))
    return texels


def substitute_patches(
    patch_scene: PatchScene,
    invalid: np.ndarray,
    light_of: Callable[[np.ndarray], np.ndarray],
    find_pairs: Callable[[PatchScene, np.ndarray], PatchPairs] = find_substitutes,
) -> np.ndarray | None:
    """Return the substitute of each patch, (n,) int64, valid patches themselves; None if all are valid.

    The substitute is the brightest candidate that is not brighter than the harmonic mean of all candidates.
    Under a thin wall with light on one side that mean is dark, so the dark side takes no light of the lit
    side. Elsewhere it has less bias than the darkest candidate, and a brighter one would add energy. A patch
    without candidates is its own substitute.

    patch_scene:  patches of the scene, or patch groups
    invalid:      (n,) bool, invalid patches
    light_of:     returns E/pi, (k, 3), of some patches, (k,) int64
    find_pairs:   `find_substitutes`, or a version that caches its last results
    """
    if not invalid.any():
        return None
    patch, neighbour = find_pairs(patch_scene, invalid)

    light = channel_sum(light_of(neighbour)).astype(np.float64)

    # The first pair of each patch is the closest to the mean that is not brighter.
    above = light - _harmonic_means(light, patch)
    order = np.lexsort((np.abs(above), above > 0, patch))
    patch, first = np.unique(patch[order], return_index=True)
    result = np.arange(len(invalid))
    result[patch] = neighbour[order[first]]
    return result


def _harmonic_means(light: np.ndarray, patch: np.ndarray) -> np.ndarray:
    """Return the harmonic mean of the light of all candidates of the same patch, (p,) float64, by candidate.

    light:  (p,) float64, light of the candidates
    patch:  (p,) int64, patch of each candidate
    """
    faintest = max(_FAINTEST * float(light.max(initial=0)), 1e-30)
    # Numbers without gaps, so that memory grows with the pairs, not with the patches.
    number = np.unique(patch, return_inverse=True)[1]
    inverse = np.bincount(number, 1 / np.maximum(light, faintest))
    mean: np.ndarray = np.bincount(number) / np.maximum(inverse, 1e-30)
    return mean[number]


def _valid_neighbours(patch_scene: PatchScene, invalid: np.ndarray, texels: np.ndarray) -> PatchPairs:
    """Return pairs of invalid patches in the given texels and valid neighbours on the same plane.

    patch_scene:  patches of the scene
    invalid:      (n,) bool, invalid patches
    texels:       (k,) int64, texels of invalid patches, see `PatchList.key`
    """
    entries = entries_around(patch_scene.texel_to_patch, texels)
    place, step = nonzero_entries(np.concatenate([[False], ~invalid])[entries])
    patch, neighbour = entries[place, 4] - 1, entries[place, step] - 1
    here, there = patch_scene.geometry.subset(patch), patch_scene.geometry.subset(neighbour)
    alike = np.einsum("pd,pd->p", here.geometric, there.geometric) > _ALIKE
    off = np.abs(np.einsum("pd,pd->p", there.center - here.center, here.geometric))
    alike &= off < _NEAR * patch_scene.geometry.steps.longer[here.triangle]
    return patch[alike], neighbour[alike]
