"""Charts turned by quarters: borders stay between texels, but what is round nests better."""

from __future__ import annotations

import numpy as np

from .atlas_bitmap import ChartBitmap

#: Charts that take less than this part of a page waste little, whichever way they lie.
_LITTLE = 1 / 1024


def may_be_turned(shape: ChartBitmap, width: int) -> bool:
    """Return whether turning a shape may be of use on a page of some width."""
    return not shape.is_rectangle and shape.width * shape.height >= _LITTLE * width**2


def turned_points(points: np.ndarray, boxes: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Return points, (n, 2) from the corner of their box, turned with it to the left by quarters, (n,)."""
    (x, y), (width, height) = points.T, boxes.T
    ways = [(x, y), (height - y, x), (width - x, height - y), (y, width - x)]
    turned: np.ndarray = np.stack([np.choose(turns, [way[axis] for way in ways]) for axis in (0, 1)], axis=1)
    return turned
