"""Patches that send out the light of hidden ones, whose texels are seen in part."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..direct.contact import Contacts
from ..patches.patch_scene import PatchScene
from ..patches.texels_around import beside_any, entries_around
from ..row_ops import nonzero_entries
from ..scene.color import channel_sum
from ..solve.solver import Seen
from ..threaded_slabs import taken
from ..validity.invalid import is_invalid

#: Texels that are looked around at once.
_TEXELS = 1 << 18

#: Least cosine between normals of a hidden patch and its stand-in; how far that is off its plane, texels.
_ALIKE, _NEAR = 0.9, 0.5


#: Numbers of hidden patches, and of one that is seen beside each, (p,) int64 twice.
PatchPairs = tuple[np.ndarray, np.ndarray]


def find_substitutes(parts: PatchScene, hidden: np.ndarray) -> PatchPairs:
    """Return hidden patches, and those that are seen in texels beside theirs, on the same plane.

    hidden: (n,) bool, of all patches, some of them
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
    """Return the patch that stands in for each one, (n,) int64: itself, if it is seen; None if all are.

    For a patch that nobody sees, as one whose centre is under a box, it is the darkest of those that are seen
    in texels beside its own, on the same plane: what is seen of its texel has their light, and under a thin
    wall the dark side must not get that of the lit one. Without one a patch is its own.

    near        what faces nearby do to the patches
    seen_light  what they have gathered
    beside      `find_substitutes`, or what remembers its last result
    """
    hidden = is_invalid(seen_light.front, near)
    if not hidden.any():
        return None
    patch, seen = beside(parts, hidden)

    # The first of each patch's pairs, the darkest before others.
    order = np.lexsort((channel_sum(seen_light.light_of(seen)), patch))
    patch, first = np.unique(patch[order], return_index=True)
    result = np.arange(len(hidden))
    result[patch] = seen[order[first]]
    return result


def _seen_beside(parts: PatchScene, hidden: np.ndarray, texels: np.ndarray) -> PatchPairs:
    """Return what `find_substitutes` does, of some texels.

    texels: (k,) int64, of hidden patches, see `PatchList.key`
    """
    entries = entries_around(parts.texel_to_patch, texels)
    place, step = nonzero_entries(np.concatenate([[False], ~hidden])[entries])
    patch, beside = entries[place, 4] - 1, entries[place, step] - 1
    here, there = parts.geometry.part(patch), parts.geometry.part(beside)
    alike = np.einsum("pd,pd->p", here.geometric, there.geometric) > _ALIKE
    off = np.abs(np.einsum("pd,pd->p", there.center - here.center, here.geometric))
    alike &= off < _NEAR * parts.geometry.steps.longer[here.triangle]
    return patch[alike], beside[alike]
