"""Limits of the coordinates that can be baked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....engine.scene.checks import LARGEST
from ..messages import NOT_FINITE, TOO_FAR


def coordinate_issue(points: np.ndarray, middle: np.ndarray | None = None) -> str | None:
    """Return the problem of points, (n, 3) in world space: not finite or too far apart; None without one.

    middle:  (3,) float64, point from which distances are measured; None for the extent of the points
             themselves
    """
    if not np.isfinite(points).all():
        return NOT_FINITE
    low, high = points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)
    reach = high - low if middle is None else np.maximum(high - middle, middle - low)
    return TOO_FAR if (reach > LARGEST).any() else None


def middle_of(boxes: Sequence[np.ndarray]) -> np.ndarray:
    """Return the median of the corners of boxes, (8, 3) each, as (3,) float64; 0 without a finite corner.

    Positions relative to it keep their precision as float32, wherever the scene is, and even if one of its
    objects is far away.
    """
    points = np.concatenate([np.zeros((0, 3)), *boxes])
    points = points[np.isfinite(points).all(axis=1)]
    return np.quantile(points, 0.5, axis=0, method="lower") if len(points) else np.zeros(3)
