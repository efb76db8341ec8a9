"""Charts moved such that their borders lie between texels (paper, VI.B, on the side of the unwrap).

What is moved are lines: all points of a chart at one u, if a border of the chart runs along that line, go to
the nearest border of texels; so do those at one v. What lies between two lines is stretched with them: grids
stay grids. No point moves by more than half a texel.
"""

from __future__ import annotations

import numpy as np

#: An edge runs along an axis if it leaves it by less than this part of its length.
_ALONG = 1e-3

#: Lines that are nearer to each other than this are one, texels.
_ONE = 1e-3

#: What lies between two lines is stretched or squeezed by this factor at most, or the chart stays as it is.
_MOST = 3.0


class Alignment:
    """Where points of charts go on both axes.

    texels   (l, 2) float64, of each loop, from the corner of its chart
    chart    (l,) int64, of each loop
    borders  (b, 2) int64, loops at the ends of edges on borders
    boxes    (c, 2) int64, columns and rows of each chart's box, whose sides stay
    """

    def __init__(self, texels: np.ndarray, chart: np.ndarray, borders: np.ndarray, boxes: np.ndarray) -> None:
        self._axes = [_Axis(texels, chart, borders, boxes[:, axis], axis) for axis in (0, 1)]

    def moved(self, texels: np.ndarray, chart: np.ndarray) -> np.ndarray:
        """Return points of charts, (n, 2), with borders between texels."""
        return np.stack([self._axes[axis].moved(texels[:, axis], chart) for axis in (0, 1)], axis=1)


class _Axis:
    """Where lines of all charts are on one axis, and where they go: charts lie one behind another on it."""

    def __init__(
        self, texels: np.ndarray, chart: np.ndarray, borders: np.ndarray, sides: np.ndarray, axis: int
    ) -> None:
        self._start = np.concatenate([[0], np.cumsum(sides[:-1] + 1)]).astype(np.float64)
        run = texels[borders[:, 1]] - texels[borders[:, 0]]
        ends = borders[np.abs(run[:, axis]) <= _ALONG * np.abs(run[:, 1 - axis])].reshape(-1)
        charts = np.arange(len(sides))

        # What runs along a side of the box is that side.
        line, of_line = texels[ends, axis], chart[ends]
        between = (line > _ONE) & (line < sides[of_line] - _ONE)
        of_line = np.r_[of_line[between], charts, charts]
        place = np.concatenate([line[between], np.zeros(len(sides)), sides]) + self._start[of_line]
        order = np.argsort(place, kind="stable")
        place, of_line = place[order], of_line[order]
        fresh = np.diff(place, prepend=-np.inf) > _ONE
        place, of_line = place[fresh], of_line[fresh]
        target = np.round(place)

        # Lines that would fall on one another stay where they are, but for those that are there already.
        firm = np.abs(place - target) <= _ONE
        alone = np.bincount(target.astype(np.int64))[target.astype(np.int64)] == 1
        kept = firm | alone
        place, of_line, target = place[kept], of_line[kept], target[kept]

        # Charts that would be bent too much stay as they are.
        gap, wanted = np.diff(place), np.diff(target)
        bent = (wanted * _MOST < gap) | (wanted > _MOST * gap)
        bent &= of_line[1:] == of_line[:-1]
        spoilt = np.zeros(len(sides), bool)
        spoilt[of_line[1:][bent]] = True
        self._place, self._target = place, np.where(spoilt[of_line], place, target)

    def moved(self, values: np.ndarray, chart: np.ndarray) -> np.ndarray:
        """Return values, (n,), of points of charts."""
        start = self._start[chart]
        moved: np.ndarray = np.interp(values + start, self._place, self._target) - start
        return moved
