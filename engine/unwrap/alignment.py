"""Alignment of chart borders to texel boundaries (paper, VI.B, done in the unwrap).

Axis-parallel borders of a chart define lines of constant u or v. Each line moves to the nearest texel
boundary, and points between two lines are interpolated, so grids stay grids. No point moves by more than half
a texel.
"""

from __future__ import annotations

import numpy as np

#: Maximum slope of an edge that counts as axis-parallel.
_ALONG = 1e-3

#: Maximum distance in texels of two lines that are treated as one.
_ONE = 1e-3

#: Maximum stretch between two lines; a chart that needs more stays unchanged.
_MOST = 3.0


class Alignment:
    """Piecewise linear displacement of chart points along both axes.

    texels:   (l, 2) float64, position of each loop from the corner of its chart
    chart:    (l,) int64, chart of each loop
    borders:  (b, 2) int64, loops at the ends of border edges
    boxes:    (c, 2) int64, columns and rows of each chart's box, whose sides stay
    """

    def __init__(self, texels: np.ndarray, chart: np.ndarray, borders: np.ndarray, boxes: np.ndarray) -> None:
        self._axes = [_Axis(texels, chart, borders, boxes[:, axis], axis) for axis in (0, 1)]

    def moved(self, texels: np.ndarray, chart: np.ndarray) -> np.ndarray:
        """Return points of charts, (n, 2), after alignment."""
        return np.stack([self._axes[axis].moved(texels[:, axis], chart) for axis in (0, 1)], axis=1)


class _Axis:
    """Lines of all charts along one axis and their new positions.

    Charts are concatenated on one number line.
    """

    def __init__(
        self, texels: np.ndarray, chart: np.ndarray, borders: np.ndarray, sides: np.ndarray, axis: int
    ) -> None:
        self._start = np.concatenate([[0], np.cumsum(sides[:-1] + 1)]).astype(np.float64)
        run = texels[borders[:, 1]] - texels[borders[:, 0]]
        ends = borders[np.abs(run[:, axis]) <= _ALONG * np.abs(run[:, 1 - axis])].reshape(-1)
        charts = np.arange(len(sides))

        # Lines along a side of the box coincide with that side.
        line, of_line = texels[ends, axis], chart[ends]
        between = (line > _ONE) & (line < sides[of_line] - _ONE)
        of_line = np.r_[of_line[between], charts, charts]
        place = np.concatenate([line[between], np.zeros(len(sides)), sides]) + self._start[of_line]
        order = np.argsort(place, kind="stable")
        place, of_line = place[order], of_line[order]
        fresh = np.diff(place, prepend=-np.inf) > _ONE
        place, of_line = place[fresh], of_line[fresh]
        target = np.round(place)

        # Lines that would end on the same boundary stay unchanged, unless they lie on a boundary already.
        firm = np.abs(place - target) <= _ONE
        alone = np.bincount(target.astype(np.int64))[target.astype(np.int64)] == 1
        kept = firm | alone
        place, of_line, target = place[kept], of_line[kept], target[kept]

        # Charts that would be stretched too much stay unchanged.
        gap, wanted = np.diff(place), np.diff(target)
        bent = (wanted * _MOST < gap) | (wanted > _MOST * gap)
        bent &= of_line[1:] == of_line[:-1]
        spoilt = np.zeros(len(sides), bool)
        spoilt[of_line[1:][bent]] = True
        self._place, self._target = place, np.where(spoilt[of_line], place, target)

    def moved(self, values: np.ndarray, chart: np.ndarray) -> np.ndarray:
        """Return coordinates of chart points, (n,), after alignment."""
        start = self._start[chart]
        moved: np.ndarray = np.interp(values + start, self._place, self._target) - start
        return moved
