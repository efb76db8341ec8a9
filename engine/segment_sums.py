"""Sums of rows by the segment that each belongs to."""

from __future__ import annotations

import numpy as np


def segment_sums(values: np.ndarray, segment: np.ndarray, count: int) -> np.ndarray:
    """Return the sum of the rows of each segment, (n, c) or (n,) -> (count, c) or (count,) float64.

    segment: (n,) int of each row, below count; columns are summed one after the other, in float64
    """
    if values.ndim == 1:
        return np.bincount(segment, values, count)
    return np.stack([np.bincount(segment, column, count) for column in values.T], axis=1)
