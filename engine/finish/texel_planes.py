"""Planes through the light of samples around texels: how light goes on to where nobody sees it."""

from __future__ import annotations

import math

import numpy as np

from ..runs import run_numbers, run_starts
from ..segment_sums import segment_sums
from ..short_rows import column_range

#: Variance of places, texels squared, which light has no slope over: that of noise stays small.
_STEADY = 0.003

#: Light goes on by its slope as far as so many standard deviations of the samples' places, and no farther.
_FARTHEST = 1.4

#: How far light may go on beyond the range of the samples around, in parts of that range: a plane through
#: somewhat more than a texel is read up to a texel beyond it.
_BEYOND = 1.0


class TexelPlanes:
    """Planes with the least weighted squares to the samples of 3 x 3 texels, around centres of some texels.

    texels   (k,) int64, sorted, atlas * r * r + texel, that have samples
    starts   (k,) int64, the first sample of each of `texels`: the samples are in their order
    place    (m, 2) float64, of samples from the centres of their texels, texels
    weight   (m,) float64, of samples
    around   (t,) int64, flat indices of those that planes are around
    """

    def __init__(
        self,
        texels: np.ndarray,
        starts: np.ndarray,
        place: np.ndarray,
        weight: np.ndarray,
        around: np.ndarray,
        resolution: int,
    ) -> None:
        # Of all texels only those count that planes go through.
        steps = steps_around(texels, around, resolution)
        used = np.zeros(len(texels), bool)
        for texel, *_ in steps:
            used[texel] = True
        new = np.cumsum(used) - 1
        self._steps = [(new[texel], there, step) for texel, there, step in steps]
        number = run_numbers(starts, len(place))
        self._chosen = np.flatnonzero(used[number])
        self._number = new[number[self._chosen]]
        self._starts, self._weight = run_starts(self._number), weight[self._chosen]
        self._count = int(used.sum()), len(around)
        places = place[self._chosen]
        self._basis = np.concatenate([np.ones((len(places), 1)), places], axis=1)

        # Normal equations; across a line that all samples lie on there is no slope.
        sums = self._sums(self._basis[:, :, None] * self._basis[:, None])
        normal = np.zeros((len(around), 3, 3))
        for texel, there, step in self._steps:
            normal[there] += _shifted(_shifted(sums[texel], step).transpose(0, 2, 1), step).transpose(0, 2, 1)
        self._total = normal[:, 0, 0].copy()
        normal[:, (1, 2), (1, 2)] += _STEADY * normal[:, :1, 0]
        self._inverse = _inverse(normal)

    def through(self, values: np.ndarray) -> np.ndarray:
        """Return what planes are at the centres, and their slopes along u and v, (t, 3, c) float64.

        values: (m, c), of the samples
        """
        sums = self._sums(self._basis[:, :, None] * values[self._chosen, None])
        right = np.zeros((self._count[1], 3, values.shape[1]))
        for texel, there, step in self._steps:
            right[there] += _shifted(sums[texel], step)
        planes: np.ndarray = self._inverse @ right
        return planes

    def rise(self, planes: np.ndarray, number: np.ndarray, way: np.ndarray) -> np.ndarray:
        """Return how much more light planes have a way off, (p, c) float64.

        A way that is longer than the samples around spread along it (a Mahalanobis distance of 1.4) is cut
        short: slopes across a strip of samples are those of its noise, times how far they are carried.

        planes  (t, 3, c), see `through`
        number  (p,) int64, of the planes
        way     (p, 2), texels along u and v
        """
        spread = np.einsum("pd,pde,pe->p", way, self._inverse[number, 1:, 1:], way) * self._total[number]
        part = _FARTHEST / np.sqrt(np.maximum(spread, _FARTHEST**2))
        rise: np.ndarray = np.einsum("pd,pdc->pc", way * part[:, None], planes[number, 1:])
        return rise

    def bounded(self, light: np.ndarray, values: np.ndarray, number: np.ndarray) -> np.ndarray:
        """Return light, (p, c), within the range of the samples around planes, and as much beyond.

        values  (m, c), of the samples: nothing leaves the range of all of them
        number  (p,) int64, of the planes
        """
        mine = values[self._chosen]
        least, most = (reduce.reduceat(mine, self._starts) for reduce in (np.minimum, np.maximum))
        low, high = np.full((2, self._count[1], values.shape[1]), [[[np.inf]], [[-np.inf]]])
        for texel, there, _ in self._steps:
            low[there] = np.minimum(low[there], least[texel])
            high[there] = np.maximum(high[there], most[texel])
        beyond = _BEYOND * (high - low)
        darkest, brightest = column_range(values)
        low, high = np.maximum(low - beyond, darkest), np.minimum(high + beyond, brightest)
        within: np.ndarray = np.clip(light, low[number], high[number])
        return within

    def _sums(self, values: np.ndarray) -> np.ndarray:
        """Return sums of values of samples, (m, a, b), times their weights, over each texel, (k, a, b)."""
        rows = values.reshape(len(values), math.prod(values.shape[1:])) * self._weight[:, None]
        return segment_sums(rows, self._number, self._count[0]).reshape(self._count[0], *values.shape[1:])


def _shifted(moments: np.ndarray, step: tuple[int, int]) -> np.ndarray:
    """Return sums over samples of (1, x, y) times anything, (t, 3, c), about centres a step away.

    Row by row: a product of many small matrices calls the linear algebra of NumPy for each.
    """
    right, up = step
    one, x, y = moments.transpose(1, 0, 2)
    return np.stack([one, right * one + x, up * one + y], axis=1)


def _inverse(matrices: np.ndarray) -> np.ndarray:
    """Return the inverses of symmetric matrices, (t, 3, 3) float64, by their cofactors.

    The linear algebra of NumPy is called for each of them and takes seventy times as long.
    """
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = matrices.transpose(1, 2, 0)
    first, second, third = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    middle, beside, last = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    cofactors = np.stack([first, second, third, second, middle, beside, third, beside, last], axis=1)
    determinant = xx * first + xy * second + xz * third
    inverses: np.ndarray = (cofactors / determinant[:, None]).reshape(-1, 3, 3)
    return inverses


def steps_around(
    texels: np.ndarray, around: np.ndarray, resolution: int
) -> list[tuple[np.ndarray, np.ndarray, tuple[int, int]]]:
    """Return, for each of 3 x 3 steps, the numbers of texels that lead to others, of these, and the step.

    The step, texels along u and v, is from a centre in `around` to that of the other texel.
    """
    found = []
    row, column = np.divmod(around % resolution**2, resolution)
    for up in (-1, 0, 1):
        for right in (-1, 0, 1):
            key = around + up * resolution + right
            number = np.minimum(np.searchsorted(texels, key), max(len(texels) - 1, 0))
            inside = (row + up >= 0) & (row + up < resolution) & (column + right >= 0)
            inside &= column + right < resolution
            there = np.flatnonzero(inside & (texels[number] == key)) if len(texels) else row[:0]
            found.append((number[there], there, (right, up)))
    return found
