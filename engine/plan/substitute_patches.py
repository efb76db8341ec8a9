"""Substitute patches: valid neighbours whose light stands for that of invalid patches.

Part of an invalid patch's texel may be visible; rays that hit it need plausible light.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..array_ops import nonzero_entries, taken
from ..direct.contact import Contacts
from ..patches.patch_scene import PatchScene
from ..patches.texels_around import beside_any, entries_around
from ..scene.color import channel_sum
from ..solve.solver import Seen
from ..validity.invalid import is_invalid

#: Texels that are processed at once.
_TEXELS = 1 << 18

#: Minimum cosine between the normals of a patch and its substitute, and maximum distance between their
#: planes, texels.
_ALIKE, _NEAR = 0.9, 0.5


#: Pairs of an invalid patch and a valid neighbour, two (p,) int64 arrays.
PatchPairs = tuple[np.ndarray, np.ndarray]


def find_substitutes(parts: PatchScene, hidden: np.ndarray) -> PatchPairs:
    """Return pairs of invalid patches and valid ones in neighbouring texels on the same plane.

    hidden  (n,) bool, invalid patches; at least one
    """
    shown = parts.texel_to_patch
    of_hidden = taken(np.concatenate([[False], hidden]), shown.ravel()).reshape(shown.shape)
    texels = np.flatnonzero(of_hidden & beside_any((shown > 0) & ~of_hidden))
    pairs = [
        _seen_beside(parts, hidden, texels[first : first + _TEXELS])
        for first in range(0, max(len(texels), 1), _TEXELS)
    ]
    patch, beside = (np.concatenate(numbers) for numbers in zip(*pairs, strict=True))
    return patch, beside


def substitute_patches(
    parts: PatchScene,
    near: Contacts,
    seen_light: Seen,
    beside: Callable[[PatchScene, np.ndarray], PatchPairs] = find_substitutes,
) -> np.ndarray | None:
    """Return the substitute of each patch, (n,) int64, valid patches themselves; None if all are valid.

    The substitute is the darkest of the candidates, so that under a thin wall the dark side takes no light of
    the lit side. A patch without candidates is its own substitute.

    parts       patches of the scene
    near        contacts of the patches
    seen_light  gathered light of the patches
    beside      `find_substitutes`, or a version that caches its last result
    """
    hidden = is_invalid(seen_light.front, near)
    if not hidden.any():
        return None
    patch, seen = beside(parts, hidden)

    # The first pair of each patch is the darkest.
    order = np.lexsort((channel_sum(seen_light.light_of(seen)), patch))
    patch, first = np.unique(patch[order], return_index=True)
    result = np.arange(len(hidden))
    result[patch] = seen[order[first]]
    return result


def _seen_beside(parts: PatchScene, hidden: np.ndarray, texels: np.ndarray) -> PatchPairs:
    """Return the pairs of `find_substitutes` for some texels.

    parts   patches of the scene
    hidden  (n,) bool, invalid patches
    texels  (k,) int64, texels of invalid patches, see `PatchList.key`
    """
    entries = entries_around(parts.texel_to_patch, texels)
    place, step = nonzero_entries(np.concatenate([[False], ~hidden])[entries])
    patch, beside = entries[place, 4] - 1, entries[place, step] - 1
    here, there = parts.geometry.part(patch), parts.geometry.part(beside)
    alike = np.einsum("pd,pd->p", here.geometric, there.geometric) > _ALIKE
    off = np.abs(np.einsum("pd,pd->p", there.center - here.center, here.geometric))
    alike &= off < _NEAR * parts.geometry.steps.longer[here.triangle]
    return patch[alike], beside[alike]
