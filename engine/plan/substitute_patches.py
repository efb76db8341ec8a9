"""Substitute patches: a valid neighbour whose reflected light replaces that of an invalid patch.

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


def find_substitutes(patch_scene: PatchScene, hidden: np.ndarray) -> PatchPairs:
    """Return pairs of invalid patches and valid ones in neighbouring texels on the same plane.

    hidden:  (n,) bool, invalid patches; at least one
    """
    shown = patch_scene.texel_to_patch
    of_hidden = taken(np.concatenate([[False], hidden]), shown.ravel()).reshape(shown.shape)
    texels = np.flatnonzero(of_hidden & beside_any((shown > 0) & ~of_hidden))
    pairs = [
        _valid_neighbours(patch_scene, hidden, texels[first : first + _TEXELS])
        for first in range(0, max(len(texels), 1), _TEXELS)
    ]
    patch, neighbour = (np.concatenate(numbers) for numbers in zip(*pairs, strict=True))
    return patch, neighbour


def substitute_patches(
    patch_scene: PatchScene,
    contacts: Contacts,
    gathered: Seen,
    find_pairs: Callable[[PatchScene, np.ndarray], PatchPairs] = find_substitutes,
) -> np.ndarray | None:
    """Return the substitute of each patch, (n,) int64, valid patches themselves; None if all are valid.

    The substitute is the darkest of the candidates, so that under a thin wall the dark side takes no light of
    the lit side. A patch without candidates is its own substitute.

    patch_scene:  patches of the scene
    contacts:     contacts of the patches
    gathered:     gathered light of the patches
    find_pairs:   `find_substitutes`, or a version that caches its last result
    """
    hidden = is_invalid(gathered.front, contacts)
    if not hidden.any():
        return None
    patch, seen = find_pairs(patch_scene, hidden)

    # The first pair of each patch is the darkest.
    order = np.lexsort((channel_sum(gathered.light_of(seen)), patch))
    patch, first = np.unique(patch[order], return_index=True)
    result = np.arange(len(hidden))
    result[patch] = seen[order[first]]
    return result


def _valid_neighbours(patch_scene: PatchScene, hidden: np.ndarray, texels: np.ndarray) -> PatchPairs:
    """Return pairs of invalid patches in the given texels and valid neighbours on the same plane.

    patch_scene:  patches of the scene
    hidden:       (n,) bool, invalid patches
    texels:       (k,) int64, texels of invalid patches, see `PatchList.key`
    """
    entries = entries_around(patch_scene.texel_to_patch, texels)
    place, step = nonzero_entries(np.concatenate([[False], ~hidden])[entries])
    patch, neighbour = entries[place, 4] - 1, entries[place, step] - 1
    here, there = patch_scene.geometry.part(patch), patch_scene.geometry.part(neighbour)
    alike = np.einsum("pd,pd->p", here.geometric, there.geometric) > _ALIKE
    off = np.abs(np.einsum("pd,pd->p", there.center - here.center, here.geometric))
    alike &= off < _NEAR * patch_scene.geometry.steps.longer[here.triangle]
    return patch[alike], neighbour[alike]
