"""Color encodings, and channel arithmetic that is fast in NumPy."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..array_ops import map_slabs

#: Luminance weights of the channels (ITU-R BT.709).
_LUMINANCE = (0.2126, 0.7152, 0.0722)


def channel_sum(values: np.ndarray) -> np.ndarray:
    """Return the sum over the channels, (n, c) -> (n,), same dtype.

    Adds column by column: NumPy sums short rows six times slower. A product with ones would start the BLAS
    threads, which then spin on all cores.
    """
    sums = np.empty(len(values), values.dtype)

    def add(slab: slice) -> None:
        first, *others = values[slab].T
        sums[slab] = first
        for channel in others:
            np.add(sums[slab], channel, out=sums[slab])

    map_slabs(len(values), 4 * values.shape[1], add)
    return sums


def luminance(values: np.ndarray, dtype: npt.DTypeLike = None) -> np.ndarray:
    """Return the luminance of linear Rec.709 colors (ITU-R BT.709), (..., 3) float -> (...).

    The engine also weights colors of other working spaces by it, which then is no exact luminance: for the
    dominant direction and thresholds. Adds column by column, like `channel_sum`.

    values:  (..., 3) float
    dtype:   dtype of the sum and the result; None for the dtype of the values
    """
    colors = values.reshape(-1, values.shape[-1])
    total = np.empty(len(colors), dtype or values.dtype)

    def add(slab: slice) -> None:
        here, part = total[slab], np.empty_like(total[slab])
        np.multiply(colors[slab, 0], _LUMINANCE[0], out=here, dtype=total.dtype)
        for channel in (1, 2):
            np.multiply(colors[slab, channel], _LUMINANCE[channel], out=part, dtype=total.dtype)
            here += part

    map_slabs(len(colors), 4 * total.itemsize, add)
    return total.reshape(values.shape[:-1])


def colors_of(values: np.ndarray) -> np.ndarray:
    """Return a copy of the first three channels of values, (n, c) -> (n, 3), column by column."""
    colors = np.empty((len(values), 3), values.dtype)
    for channel in range(3):
        colors[:, channel] = values[:, channel]
    return colors


def add_colors(values: np.ndarray, colors: np.ndarray, sign: int = 1) -> None:
    """Add colors, (n, 3), times 1 or -1, to the first three channels of values, (n, c), in place.

    Adds column by column, like `channel_sum`.
    """
    add = np.add if sign > 0 else np.subtract
    for channel in range(3):
        add(values[:, channel], colors[:, channel], out=values[:, channel])


def rest_of(light: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Return light, (n, c), minus a part of it, (n, 3), clamped to at least 0: (n, 3)."""
    rest = np.empty((len(light), 3), light.dtype)
    for channel in range(3):
        np.subtract(light[:, channel], part[:, channel], out=rest[:, channel])
    return np.maximum(rest, 0, out=rest)


def srgb_to_linear(values: np.ndarray) -> np.ndarray:
    """Return sRGB-encoded values as scene-linear values (IEC 61966-2-1)."""
    linear: np.ndarray = np.where(
        values <= 0.04045, values / 12.92, ((np.maximum(values, 0) + 0.055) / 1.055) ** 2.4
    ).astype(values.dtype)
    return linear


def linear_to_srgb(values: np.ndarray) -> np.ndarray:
    """Return scene-linear values >= 0 as sRGB-encoded values (IEC 61966-2-1)."""
    display: np.ndarray = np.where(
        values <= 0.0031308, 12.92 * values, 1.055 * values ** (1 / 2.4) - 0.055
    ).astype(values.dtype)
    return display
