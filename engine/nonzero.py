"""Nonzero rows of arrays that do not change, such as emission: found once, or noted where they are set."""

from __future__ import annotations

import weakref

import numpy as np

from .array_ops import any_in_rows, has_nonzero, nonzero_rows

#: Rows of an array for each row that may be nonzero, from which a list of these is worth keeping (chosen).
_FEW = 8

#: Rows that may be nonzero by the identity of their array; an entry lives as long as the array.
_known: dict[int, np.ndarray] = {}


def note_rows(values: np.ndarray, rows: np.ndarray) -> None:
    """Store which rows of (n, c) may be nonzero, (k,) int64 ascending; the array must not change later."""
    if _FEW * len(rows) < len(values) and id(values) not in _known:
        weakref.finalize(values, _known.pop, id(values), None).atexit = False
        _known[id(values)] = rows


def rows_once(values: np.ndarray) -> np.ndarray:
    """Return `nonzero_rows` of an array that must not change, (n, c) -> (k,) int64; a second call is fast."""
    rows = _known.get(id(values))
    if rows is None:
        rows = nonzero_rows(values)
        note_rows(values, rows)
        return rows
    return rows[any_in_rows(values[rows])]


def has_rows(values: np.ndarray) -> bool:
    """Return True if an array that must not change has a nonzero entry; fast if its rows are known."""
    rows = _known.get(id(values))
    return has_nonzero(values if rows is None else values[rows])
