"""Light that rays meet at invalid patches."""

from types import SimpleNamespace

import numpy as np
import pytest

from engine.texel_gather.invalid_texel_fill import InvalidTexelFill

WIDTH, SQUARE = 13, 4


def squares():
    """Return the patches of a full lightmap, and each one's group, a square of up to 4 x 4."""
    row, column = np.divmod(np.arange(WIDTH**2), WIDTH)
    group = row // SQUARE * (-(-WIDTH // SQUARE)) + column // SQUARE
    patches = SimpleNamespace(
        resolution=WIDTH,
        atlas=np.zeros(WIDTH**2, int),
        texel=np.arange(WIDTH**2),
        key=np.arange(WIDTH**2),
        column=column,
    )
    return patches, group


def parts_of(patches, entries):
    return SimpleNamespace(patches=patches, texel_to_patch=entries.reshape(1, WIDTH, WIDTH).astype(np.uint32))


def job_of(patches, group):
    alone = SimpleNamespace(parts=parts_of(patches, 1 + np.arange(WIDTH**2)))
    return SimpleNamespace(job=alone, solved=SimpleNamespace(parts=parts_of(patches, 1 + group)))


@pytest.mark.parametrize("first_hidden", [3, 4, 5, 6])
def test_a_hidden_group_looks_as_what_lies_beside_it(first_hidden):
    """Wherever its border lies in a square: a group's own patch may be far from it."""
    patches, group = squares()
    hidden = patches.column >= first_hidden
    group = np.where(hidden, group + group.max() + 1, group)
    group = np.unique(group, return_inverse=True)[1]
    is_dark = np.zeros(group.max() + 1, bool)
    is_dark[group[hidden]] = True
    settled = np.where(is_dark, 0.0, 0.7)[:, None] * np.float32([1, 0.5, 0.25])
    seen = InvalidTexelFill(job_of(patches, group), hidden).seen(settled.astype(np.float32))
    beside = np.unique(group[hidden & (patches.column <= first_hidden + 1)])
    assert np.allclose(seen[beside], 0.7 * np.float32([1, 0.5, 0.25]), rtol=1e-5)
    far = np.setdiff1d(group[hidden], group[patches.column <= first_hidden + 1])
    assert not seen[far].any()
    assert np.array_equal(seen[~is_dark], settled[~is_dark].astype(np.float32))
