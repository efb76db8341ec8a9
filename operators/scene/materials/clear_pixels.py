"""Fills the colours of clear pixels by pull-push (Gortler et al., "The Lumigraph", 1996).

Images of leaves are mostly black where they are clear. The engine takes the mean of a texture over each
texel, which must be the mean of its opaque part.
"""

from __future__ import annotations

import numpy as np

from ....engine.scene.color import linear_to_srgb, srgb_to_linear
from ..slice_timer import Slices, row_slices


def fill_clear(pixels: np.ndarray, is_opaque: np.ndarray, srgb: bool = False) -> Slices[np.ndarray]:
    """Return pixels, (h, w, c) float32, whose clear ones have the mean colour of opaque pixels around them.

    is_opaque:  (h, w) bool, True for at least one pixel
    srgb:       True if the pixels are sRGB-encoded; their means are those of linear colours
    """
    height, width, channels = pixels.shape
    sums = np.empty((-(-height // 2), -(-width // 2), channels + 1), np.float32)
    for rows in row_slices(len(sums), sums.shape[1] * 16):
        part = slice(2 * rows.start, 2 * rows.stop)
        weight = is_opaque[part][..., None].astype(np.float32)
        linear = srgb_to_linear(pixels[part]) if srgb else pixels[part]
        sums[rows] = _halved(np.concatenate([linear * weight, weight], axis=2))
        yield rows.stop / len(sums) / 2
    means = yield from _means(sums)
    if srgb:
        means = linear_to_srgb(means)
    filled = np.empty_like(pixels)
    for rows in row_slices(len(sums), sums.shape[1] * 16):
        part = slice(2 * rows.start, 2 * rows.stop)
        around = _doubled(means[rows], *is_opaque[part].shape)
        filled[part] = np.where(is_opaque[part][..., None], pixels[part], around)
        yield 0.5 + rows.stop / len(sums) / 2
    return filled


def _means(sums: np.ndarray) -> Slices[np.ndarray]:
    """Return mean colours, (h, w, c) float32, of sums of colours and their number, (h, w, c + 1) float32.

    Where the number is 0, the mean of the 3 x 3 pixels around counts, or that of the next coarser level.
    """
    levels = [sums]
    while max(levels[-1].shape[:2]) > 1:
        levels.append(_halved(levels[-1]))
        yield 0.5
    means = np.zeros((1, 1, sums.shape[2] - 1), np.float32)
    for level in reversed(levels):
        means = _doubled(means, *level.shape[:2])
        for near in (box_sums(level), level):
            number = near[..., -1:]
            means = np.where(number > 0, near[..., :-1] / np.maximum(number, 1), means)
            yield 0.5
    return means


def box_sums(values: np.ndarray) -> np.ndarray:
    """Return the sums of the 3 x 3 pixels around each pixel, (h, w, c); 0 counts beyond the border."""
    width = values.shape[1]
    padded = np.pad(values, ((1, 1), (1, 1), (0, 0)))
    rows = padded[:-2] + padded[1:-1] + padded[2:]
    sums: np.ndarray = rows[:, :width] + rows[:, 1 : width + 1] + rows[:, 2:]
    return sums


def _halved(values: np.ndarray) -> np.ndarray:
    """Return the sums of blocks of 2 x 2 pixels, (h, w, c) -> (ceil(h / 2), ceil(w / 2), c)."""
    height, width = values.shape[:2]
    even = np.pad(values, ((0, height % 2), (0, width % 2), (0, 0)))
    rows = even[::2] + even[1::2]
    sums: np.ndarray = rows[:, ::2] + rows[:, 1::2]
    return sums


def _doubled(values: np.ndarray, height: int, width: int) -> np.ndarray:
    """Return pixels repeated twice along both axes, cropped to a size."""
    return values.repeat(2, axis=0)[:height].repeat(2, axis=1)[:, :width]
