"""Sparse matrix in ELLPACK format: the same number of entries in each row."""

from __future__ import annotations

from functools import cached_property

import numpy as np


class EllMatrix:
    """Sparse matrix A in ELLPACK format, and products with its normal matrix A^T A.

    columns:  (m, k) int, unknown of each entry; a row may contain an unknown several times
    entries:  (m, k) float64, values
    count:    number n of unknowns
    """

    def __init__(self, columns: np.ndarray, entries: np.ndarray, count: int) -> None:
        self._columns, self._entries, self._count = columns, entries, count

    def times(self, values: np.ndarray) -> np.ndarray:
        """Return A^T A times a vector of the unknowns, (n,) float64."""
        terms = values.take(self._columns)
        product = np.einsum("mk,mk->m", self._entries, terms)
        np.multiply(self._entries, product[:, None], out=terms)
        return self._sums(terms)

    @property
    def diagonal(self) -> np.ndarray:
        """The diagonal of A^T A, (n,) float64."""
        return self._sums(self._entries**2)

    def widened(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the ranges, (n,) float64 each, widened to the ranges of unknowns in the same rows."""
        entry, start, unknown = self._by_column
        if not len(entry):
            return low, high
        low, high, row = low.copy(), high.copy(), entry // self._columns.shape[1]
        least, largest = low[self._columns].min(axis=1)[row], high[self._columns].max(axis=1)[row]
        low[unknown] = np.minimum(low[unknown], np.minimum.reduceat(least, start))
        high[unknown] = np.maximum(high[unknown], np.maximum.reduceat(largest, start))
        return low, high

    def carried(self, values: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Propagate known values, (n,): unknowns without a value take the mean of known ones in their rows.

        Repeats until no more unknowns are reached. Returns the values and the new mask, (n,) bool.
        """
        values, known = values * known, known.copy()
        while True:
            weight = self._sums(self._of_rows(known))
            reached = ~known & (weight > 0)
            if not reached.any():
                return values, known
            sums = self._sums(self._of_rows(values))
            values[reached], known[reached] = sums[reached] / weight[reached], True

    def _of_rows(self, values: np.ndarray) -> np.ndarray:
        """Return the product A x, repeated for each entry of a row, (m, k) float64."""
        sums = values[self._columns].sum(axis=1, keepdims=True)
        return np.broadcast_to(sums, self._columns.shape)

    def _sums(self, terms: np.ndarray) -> np.ndarray:
        """Return the sum of terms, (m, k), over all entries of each column, (n,) float64."""
        return np.bincount(self._columns.ravel(), terms.ravel(), self._count)

    @cached_property
    def _by_column(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Entries sorted by column, the start of each column in this order, and the column numbers."""
        entry = np.argsort(self._columns, axis=None, kind="stable")
        unknown, start = np.unique(self._columns.ravel()[entry], return_index=True)
        return entry, start, unknown
