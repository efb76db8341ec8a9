"""Reductions of short rows give what NumPy's give."""

import numpy as np
import pytest

from engine import array_ops
from engine.array_ops import (
    all_in_rows,
    any_in_rows,
    has_nonzero,
    largest_in_rows,
    nonzero_entries,
    nonzero_rows,
    row_products,
)


@pytest.mark.parametrize("shape", [(0, 3), (1, 1), (1009, 3), (31, 7)])
def test_rows_are_reduced_as_numpy_does(shape):
    values = np.random.default_rng(shape[0]).integers(-2, 3, shape).astype(np.float32)
    for rows in (values, values.T.copy().T, np.zeros(shape), np.full(shape, np.nan)):
        assert np.array_equal(any_in_rows(rows), rows.any(axis=1))
        assert np.array_equal(all_in_rows(rows), rows.all(axis=1))
        assert np.array_equal(largest_in_rows(rows), rows.max(axis=1), equal_nan=True)
        assert np.allclose(row_products(rows, rows + 1), (rows * (rows + 1)).sum(axis=1), equal_nan=True)
        assert all(map(np.array_equal, nonzero_entries(rows), np.nonzero(rows)))


@pytest.mark.parametrize("part", [0.0, 1e-5, 0.3])
@pytest.mark.parametrize("shape", [(0, 3), (1, 1), (1_000_003, 3), (70_001, 37)])
def test_rows_that_are_not_black_are_found_in_all_slabs(shape, part):
    random = np.random.default_rng(shape[0])
    values = np.zeros(shape, np.float32)
    some = random.integers(0, max(values.size, 1), int(values.size * part))
    values.ravel()[some] = random.choice([-1, np.nan, 2], len(some))
    assert np.array_equal(nonzero_rows(values), np.flatnonzero((values != 0).any(axis=1)))


@pytest.mark.parametrize("shape", [(0, 3), (1, 3), (20011, 3), (7, 5, 3)])
def test_one_nonzero_entry_anywhere_is_found(shape):
    values = np.zeros(shape, np.float32)
    assert not has_nonzero(values)
    assert not has_nonzero(-values)
    for place in {0, values.size // 2, values.size - 1} if values.size else ():
        for entry in (1e-45, -1, np.nan):
            one = values.copy()
            one.flat[place] = entry
            assert has_nonzero(one)


@pytest.mark.parametrize("count", [0, 1, 2, 7, 9973, 300_007])
@pytest.mark.parametrize("mask", [0xFFFFFFFFFFFFFFFF, 0xF0000000000003FF, 0xFF])
def test_order_of_hashes_sorts_them_even_if_leading_bits_clash(count, mask):
    keys = np.random.default_rng(count).integers(0, 2**64, count // 2 + 1, dtype=np.uint64)
    keys = np.concatenate([keys, keys[::-1]])[:count] & np.uint64(mask)
    order, ordered = array_ops.order_of_hashes(keys)
    assert (np.sort(order) == np.arange(count)).all()
    assert (keys[order] == np.sort(keys)).all() and (ordered == keys[order]).all()
