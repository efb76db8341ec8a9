"""Normal matrix of bilinear lookups: a nine-point stencil for each texel."""

from __future__ import annotations

import numpy as np

#: Pairs of lookup texels (lower left, lower right, upper left, upper right) that are neighbours along the
#: row, the column, and each diagonal.
_DIRECTIONS = (((0, 1), (2, 3)), ((0, 2), (1, 3)), ((0, 3),), ((1, 2),))


class TexelStencil:
    """A^T W A of bilinear lookups A with point weights W, stored as nine diagonals.

    footprints:  (m, 4) int64, unknowns that each lookup reads
    weights:     (m, 4) float64, lookup weights; an unknown with weight 0 is ignored
    count:       (m,) float64, weight W of each lookup
    unknowns:    number n of unknowns
    """

    def __init__(self, footprints: np.ndarray, weights: np.ndarray, count: np.ndarray, unknowns: int) -> None:
        self.diagonal = np.zeros(unknowns)
        for corner in range(4):
            self._add(self.diagonal, footprints[:, corner], count * weights[:, corner] ** 2)
        self._links = [self._linked(footprints, weights, count, pairs) for pairs in _DIRECTIONS]

    def times(self, values: np.ndarray) -> np.ndarray:
        """Return the product with a vector of the unknowns, (n,) float64."""
        product = self.diagonal * values
        for texel, neighbour, factor in self._links:
            # Indices are unique: no two texels have the same neighbour in one direction.
            product[texel] += factor * values[neighbour]
            product[neighbour] += factor * values[texel]
        return product

    def widened(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the ranges, (n,) float64 each, widened to the ranges of the neighbours."""
        wide_low, wide_high = low.copy(), high.copy()
        for texel, neighbour, _ in self._links:
            for one, other in ((texel, neighbour), (neighbour, texel)):
                wide_low[one] = np.minimum(wide_low[one], low[other])
                wide_high[one] = np.maximum(wide_high[one], high[other])
        return wide_low, wide_high

    def _linked(
        self, footprints: np.ndarray, weights: np.ndarray, count: np.ndarray, pairs: tuple
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return texels, their neighbours in one direction, and the matrix entries of the pairs, (k,)."""
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
        """Add terms to `sums` at indices, which may repeat."""
        sums += np.bincount(index, terms, len(sums))
