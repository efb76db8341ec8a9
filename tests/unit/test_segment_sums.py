"""Sums of rows by segment."""

import numpy as np
import pytest

from engine.array_ops import segment_sums


@pytest.mark.parametrize("rows", [0, 1, 1013])
def test_sums_are_those_of_numpy_add_at(rows):
    random = np.random.default_rng(rows)
    values, segment = random.normal(size=(rows, 3)).astype(np.float32), random.integers(0, 7, rows)
    expected = np.zeros((11, 3))
    np.add.at(expected, segment, values.astype(np.float64))
    assert np.allclose(segment_sums(values, segment, 11), expected, rtol=1e-12, atol=1e-15)
    assert np.allclose(segment_sums(values[:, 1], segment, 11), expected[:, 1], rtol=1e-12, atol=1e-15)


def test_small_rows_are_not_lost_beside_large_ones():
    values = np.full((1 << 20, 2), [1e-3, 1.0], np.float32)
    values[0] = 1e6
    sums = segment_sums(values, np.zeros(len(values), int), 1)
    assert np.allclose(sums, [[1e6 + 1e-3 * (len(values) - 1), 1e6 + len(values) - 1]], rtol=1e-7)
