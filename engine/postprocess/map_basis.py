"""Few of many maps whose nonnegative combinations represent all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

#: Texels whose products are summed at a time, so that their float64 copy stays below 100 MB for 50 maps.
_SLAB = 1 << 16

#: Largest gradient that counts as 0 in the search for weights, relative to the largest product.
_FLAT = 1e-12


@dataclass(frozen=True)
class MapBasis:
    """Chosen maps, and the weights that represent all maps with them.

    chosen:   indices of the k chosen maps, ascending
    weights:  (n, k, 3) float64, not negative: map = sum of weight x chosen map, for each channel
    errors:   (n,) float64, root mean square error of each map, relative to its mean absolute value
    """

    chosen: tuple[int, ...]
    weights: np.ndarray
    errors: np.ndarray


class _Products:
    """Inner products of maps, for each block of samples.

    grams:   (3, n, n) float64 for each block: mean product over the samples, by channel
    levels:  (n,) float64 for each block: mean absolute value of each map
    """

    def __init__(self, blocks: Sequence[np.ndarray]) -> None:
        used = [block for block in blocks if block.shape[1] > 0]
        self.grams = [_gram(block) for block in used]
        self.levels = [np.abs(block).mean(axis=(1, 2), dtype=np.float64) for block in used]
        self.count = len(blocks[0])
        scales = [max(float(level.mean()) ** 2, 1e-60) for level in self.levels]
        self.joint = sum(
            (gram / scale for gram, scale in zip(self.grams, scales, strict=True)),
            np.zeros((3, self.count, self.count)),
        )

    def basis(self, chosen: Sequence[int]) -> MapBasis:
        """Return the best nonnegative weights of some maps."""
        weights = np.zeros((self.count, len(chosen), 3))
        for channel, gram in enumerate(self.joint):
            inner = gram[np.ix_(chosen, chosen)]
            for number in range(self.count):
                if number in chosen:
                    weights[number, list(chosen).index(number), channel] = 1
                else:
                    weights[number, :, channel] = _nonnegative(inner, gram[list(chosen), number])
        return MapBasis(tuple(chosen), weights, self._errors(chosen, weights))

    def _errors(self, chosen: Sequence[int], weights: np.ndarray) -> np.ndarray:
        """Return the largest relative error of each map over the blocks."""
        difference = np.zeros((self.count, self.count, 3))
        difference[:, list(chosen)] = weights
        difference -= np.eye(self.count)[..., None]
        worst = np.zeros(self.count)
        for gram, level in zip(self.grams, self.levels, strict=True):
            squared = np.einsum("nac,cab,nbc->n", difference, gram, difference) / 3
            error = np.sqrt(np.maximum(squared, 0))
            worst = np.maximum(worst, np.divide(error, level, out=np.zeros_like(error), where=level > 0))
        return worst


def choose_maps(blocks: Sequence[np.ndarray], tolerance: float) -> MapBasis:
    """Return at least one map, and as few as found, that represent all maps within a tolerance.

    The map with the largest error is added until all errors are small enough; then maps that the others
    represent are dropped again. The weights are least-squares solutions.

    blocks:     (n, samples, 3) float32 of the same n > 0 maps each; the tolerance holds in each block
    tolerance:  largest root mean square error of a map, relative to its mean absolute value
    """
    products = _Products(blocks)
    basis = products.basis([])
    while not basis.chosen or basis.errors.max() > tolerance:
        basis = products.basis(sorted((*basis.chosen, int(np.argmax(basis.errors)))))
    for number in basis.chosen:
        fewer = [other for other in basis.chosen if other != number]
        without = products.basis(fewer) if fewer else basis
        if without.errors.max() <= tolerance:
            basis = without
    return basis


def _gram(block: np.ndarray) -> np.ndarray:
    """Return the mean products of n maps, (3, n, n) float64, for each channel."""
    count, samples, _ = block.shape
    total = np.zeros((3, count, count))
    for start in range(0, samples, _SLAB):
        values = block[:, start : start + _SLAB].transpose(2, 0, 1).astype(np.float64)
        total += values @ values.transpose(0, 2, 1)
    return total / samples


def _nonnegative(gram: np.ndarray, products: np.ndarray) -> np.ndarray:
    """Return the weights w >= 0, (k,), that minimize w . gram w - 2 w . products.

    Active sets by R. Bro and S. De Jong, A fast non-negativity-constrained least squares algorithm (1997).
    """
    weights, passive = np.zeros(len(products)), np.zeros(len(products), bool)
    limit = _FLAT * max(float(np.abs(products).max(initial=0.0)), 1e-300)
    for _ in range(3 * len(products)):
        gradient = np.where(passive, -np.inf, products - gram @ weights)
        if not len(gradient) or gradient.max() <= limit:
            break
        passive[int(np.argmax(gradient))] = True
        weights = _solved(gram, products, weights, passive)
    return weights


def _solved(gram: np.ndarray, products: np.ndarray, weights: np.ndarray, passive: np.ndarray) -> np.ndarray:
    """Return the weights of the passive set; weights that would become negative leave it."""
    while True:
        free = np.flatnonzero(passive)
        wanted = np.zeros_like(weights)
        wanted[free] = np.linalg.lstsq(gram[np.ix_(free, free)], products[free], rcond=None)[0]
        negative = passive & (wanted <= 0)
        if not negative.any():
            return wanted
        step = np.min(weights[negative] / np.maximum(weights[negative] - wanted[negative], 1e-300))
        weights = weights + step * (wanted - weights)
        passive &= ~(negative & (weights <= 1e-12 * max(float(weights.max()), 1e-300)))
        weights = np.where(passive, weights, 0)
