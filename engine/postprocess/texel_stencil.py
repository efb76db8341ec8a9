"""The normal equations of bilinear look-ups: each texel with its eight neighbours."""

from __future__ import annotations

import numpy as np

#: Pairs of texels of a footprint (lower left, lower right, upper left, upper right) that are neighbours in
#: one direction: along the row, along the column, and along both diagonals.
_DIRECTIONS = (((0, 1), (2, 3)), ((0, 2), (1, 3)), ((0, 3),), ((1, 2),))


class TexelStencil:
    """A^T W A of look-ups A with weights W, as a matrix of nine diagonals over unknowns.

    footprints  (m, 4) int64, numbers of the unknowns that each look-up reads
    weights     (m, 4) float64, of each of them; the number of one with weight 0 does not matter
    count       (m,) float64, what each look-up counts
    unknowns    number of unknowns
    """

    def __init__(self, footprints: np.ndarray, weights: np.ndarray, count: np.ndarray, unknowns: int) -> None:
        self.diagonal = np.zeros(unknowns)
        for corner in range(4):
            self._add(self.diagonal, footprints[:, corner], count * weights[:, corner] ** 2)
        self._links = [self._linked(footprints, weights, count, pairs) for pairs in _DIRECTIONS]

    def times(self, values: np.ndarray) -> np.ndarray:
        """Return the product with values of the unknowns, (n,) float64."""
        product = self.diagonal * values
        for texel, neighbour, factor in self._links:
            # No two texels have the same neighbour in one direction.
            product[texel] += factor * values[neighbour]
            product[neighbour] += factor * values[texel]
        return product

    def widened(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return ranges of the unknowns, two (n,) float64 arrays, that hold those of their neighbours."""
        wide_low, wide_high = low.copy(), high.copy()
        for texel, neighbour, _ in self._links:
            for one, other in ((texel, neighbour), (neighbour, texel)):
                wide_low[one] = np.minimum(wide_low[one], low[other])
                wide_high[one] = np.maximum(wide_high[one], high[other])
        return wide_low, wide_high

    def _linked(
        self, footprints: np.ndarray, weights: np.ndarray, count: np.ndarray, pairs: tuple
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return texels, their neighbours in a direction and the factors of their products, (k,) each."""
        factor, neighbour = np.zeros(len(self.diagonal)), np.zeros(len(self.diagonal), np.int64)
        for one, other in pairs:
            product = count * weights[:, one] * weights[:, other]
            self._add(factor, footprints[:, one], product)
            read = product > 0
            neighbour[footprints[read, one]] = footprints[read, other]
        linked = np.flatnonzero(factor)
        return linked, neighbour[linked], factor[linked]

    @staticmethod
    def _add(sums: np.ndarray, index: np.ndarray, terms: np.ndarray) -> None:
        """Add terms to the sums that indices name."""
        sums += np.bincount(index, terms, len(sums))
