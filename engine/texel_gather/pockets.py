"""Texel samples in narrow pockets between parts of a body, which a texel shares with lit samples."""

from __future__ import annotations

import numpy as np

from ..array_ops import range_members, run_numbers, run_starts

#: Light of a sample relative to the open samples of its texel, below which it counts as hidden in a pocket
#: (chosen). A pocket of a house has 1 to 2 % of the light outside.
_DARK = 0.1


def in_pockets(
    starts: np.ndarray, visible: np.ndarray, enclosed: np.ndarray, light: np.ndarray
) -> np.ndarray:
    """Return the samples in pockets, (k,) int64: enclosed and much darker than open samples.

    Probe rays can leave a pocket through a slit, so its samples may count as outside. Samples in a room whose
    walls face outward are enclosed, too. Its texels have no brighter open samples, so the room stays lit.

    starts:    (t,) int64, first sample of each texel
    visible:   (s,) bool, valid samples
    enclosed:  (s,) bool, see `PushOffs`
    light:     (s,) float32, E/pi, sum of the channels
    """
    hidden = np.flatnonzero(visible & enclosed)
    if not len(hidden):
        return hidden

    # Compare with the open samples of the same texels.
    texel = np.searchsorted(starts, hidden, "right") - 1
    runs = run_starts(texel)
    first, last = starts[texel[runs]], np.append(starts, len(visible))[texel[runs] + 1]
    samples, number = range_members(first, last - first), np.repeat(np.arange(len(runs)), last - first)
    is_open = visible[samples] & ~enclosed[samples]
    samples, number = samples[is_open], number[is_open]
    count = np.bincount(number, minlength=len(runs))
    mean = np.bincount(number, light[samples], len(runs)) / np.maximum(count, 1)
    pockets: np.ndarray = hidden[light[hidden] < _DARK * mean[run_numbers(runs, len(hidden))]]
    return pockets
