"""Nonzero rows of arrays are found once, or taken from a note."""

import gc

import numpy as np

from engine import nonzero
from engine.array_ops import nonzero_rows


def few(count, *rows):
    values = np.zeros((count, 3), np.float32)
    values[list(rows), 1] = 2
    return values


def test_rows_are_found_once(monkeypatch):
    values, found = few(100, 3, 90), []
    monkeypatch.setattr(nonzero, "nonzero_rows", lambda array: found.append(array) or nonzero_rows(array))
    for _ in range(2):
        assert nonzero.rows_once(values).tolist() == [3, 90]
    assert len(found) == 1


def test_a_note_may_list_rows_that_are_zero():
    values = few(100, 3)
    nonzero.note_rows(values, np.array([3, 50]))
    assert nonzero.rows_once(values).tolist() == [3] and nonzero.has_rows(values)
    dark = few(100)
    nonzero.note_rows(dark, np.array([50]))
    assert not nonzero.has_rows(dark)


def test_many_rows_are_not_noted():
    values = np.ones((16, 3), np.float32)
    assert len(nonzero.rows_once(values)) == 16 and id(values) not in nonzero._known
    assert nonzero.has_rows(values)


def test_a_note_ends_with_its_array():
    values = few(100, 3)
    nonzero.rows_once(values)
    key = id(values)
    assert key in nonzero._known
    del values
    gc.collect()
    assert key not in nonzero._known
