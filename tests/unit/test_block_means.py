"""Means over blocks of fine texels count what is known alone, in each channel."""

import numpy as np
import pytest

from tools.verification.block_means import block_means, block_shares


def test_means_and_shares_of_blocks_are_those_of_their_known_texels():
    rng = np.random.default_rng(5)
    fine, known = rng.random((2, 15, 21, 3)).astype(np.float32), rng.random((2, 15, 21, 3)) < 0.4
    known[0, :3, 3:6] = False
    means, shares = block_means(fine, known, 3), block_shares(known, 3)
    assert means.shape == shares.shape == (2, 5, 7, 3) and not means[0, 0, 1].any()
    for atlas, row, column, channel in np.ndindex(means.shape):
        block = (atlas, slice(3 * row, 3 * row + 3), slice(3 * column, 3 * column + 3), channel)
        assert shares[atlas, row, column, channel] == pytest.approx(known[block].mean())
        if known[block].any():
            expected = fine[block][known[block]].mean()
            assert means[atlas, row, column, channel] == pytest.approx(expected, rel=1e-5)
