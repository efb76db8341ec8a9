"""Connected components of texels: the charts as areas of the lightmap."""

from __future__ import annotations

import numpy as np

from ..unwrap.adjacency import components


def connected_texels(known: np.ndarray) -> np.ndarray:
    """Return the component number of each known texel, (k,) int64, in texel order.

    Texels of a row form runs; runs of adjacent rows are joined if they share a column.

    known:  (atlases, h, w) bool; components are 4-connected
    """
    _, height, width = known.shape
    padded = np.pad(known.reshape(-1, width), [(0, 0), (1, 1)])
    before, after = padded[:, :-1], padded[:, 1:]

    # Rows get a padding column, so that texels at the end of one row and the start of the next are not
    # neighbours.
    pitch = width + 1
    starts, ends = np.flatnonzero(after > before), np.flatnonzero(before > after)
    row = starts // pitch
    first = np.searchsorted(ends, starts + pitch, side="right")
    last = np.where((row + 1) % height > 0, np.searchsorted(starts, ends + pitch, side="left"), first)
    count = last - first
    above = np.repeat(np.arange(len(row)), count)
    below = np.arange(len(above)) - np.repeat(np.cumsum(count) - count - first, count)
    return np.repeat(components(len(row), above, below), ends - starts)
