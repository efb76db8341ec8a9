"""Quarter turns of charts, which keep borders at texel boundaries and improve packing."""

from __future__ import annotations

import numpy as np

from .atlas_bitmap import ChartBitmap

#: Minimum box area of a chart that is worth turning, as a fraction of the page.
_LITTLE = 1 / 1024


def may_be_turned(shape: ChartBitmap, width: int) -> bool:
    """Return True if turning a chart may improve the packing of a page of some width."""
    return not shape.is_rectangle and shape.width * shape.height >= _LITTLE * width**2


def turned_points(points: np.ndarray, boxes: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Return points, (n, 2) relative to their box, rotated counter-clockwise by quarter turns, (n,)."""
    (x, y), (width, height) = points.T, boxes.T
    ways = [(x, y), (height - y, x), (width - x, height - y), (y, width - x)]
    turned: np.ndarray = np.stack([np.choose(turns, [way[axis] for way in ways]) for axis in (0, 1)], axis=1)
    return turned
