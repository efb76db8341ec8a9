"""Texel samples in narrow pockets between parts of a body, which a texel shares with lit samples."""

from __future__ import annotations

import numpy as np

from ..array_ops import run_numbers, run_starts

#: Light of a sample relative to the open samples of its texel, below which it counts as hidden in a pocket
#: (chosen). A pocket of a house has 1 to 2 % of the light outside.
_DARK = 0.1


def in_pockets(keys: np.ndarray, visible: np.ndarray, enclosed: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Return a mask of the samples in pockets, (s,) bool: enclosed and much darker than open samples.

    Probe rays can leave a pocket through a slit, so its samples may count as outside. Samples in a room whose
    walls face outward are enclosed, too. Its texels have no brighter open samples, so the room stays lit.

    keys:      (s,) int64, texel of each sample, ascending
    visible:   (s,) bool, valid samples
    enclosed:  (s,) bool, see `PushOffs`
    light:     (s,) float32, E/pi, sum of the channels
    """
    starts = run_starts(keys)
    number = run_numbers(starts, len(keys))
    is_open = visible & ~enclosed
    count = np.bincount(number[is_open], minlength=len(starts))
    mean = np.bincount(number[is_open], light[is_open], len(starts)) / np.maximum(count, 1)
    pockets: np.ndarray = visible & enclosed & (light < _DARK * mean[number])
    return pockets
