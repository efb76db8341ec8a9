"""Texels that hang together: the charts of lightmaps, as their texels show them."""

from __future__ import annotations

import numpy as np

from ..unwrap.adjacency import components


def connected_texels(known: np.ndarray) -> np.ndarray:
    """Return the number of the chart of each known texel, in their order, (k,) int64.

    known: (atlases, h, w) bool; charts are known texels that are side by side.

    Texels of a row are joined as runs, and runs with those of the next row that they share a column with.
    """
    _, height, width = known.shape
    padded = np.pad(known.reshape(-1, width), [(0, 0), (1, 1)])
    before, after = padded[:, :-1], padded[:, 1:]

    # Numbers along all rows, one behind the other: those of the next row are larger by the pitch.
    pitch = width + 1
    starts, ends = np.flatnonzero(after > before), np.flatnonzero(before > after)
    row = starts // pitch
    first = np.searchsorted(ends, starts + pitch, side="right")
    last = np.where((row + 1) % height > 0, np.searchsorted(starts, ends + pitch, side="left"), first)
    count = last - first
    above = np.repeat(np.arange(len(row)), count)
    below = np.arange(len(above)) - np.repeat(np.cumsum(count) - count - first, count)
    return np.repeat(components(len(row), above, below), ends - starts)
