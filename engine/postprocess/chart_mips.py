"""Mip levels of a lightmap that mix no light of different charts."""

from __future__ import annotations

import numpy as np

from ..patches.texel_components import connected_texels

#: Shifts to the four neighbors of a texel: axis and direction.
_NEIGHBORS = ((0, 1), (0, -1), (1, 1), (1, -1))


def chart_mips(light: np.ndarray, has_patch: np.ndarray) -> list[np.ndarray]:
    """Return the mip levels of a lightmap, the lightmap first, (h / 2^k, w / 2^k, 3) float32.

    A texel is the mean of those of the four texels below it that belong to a chart. Texels next to a chart
    repeat its light. Levels end where a texel would cover two charts or touch another chart, since linear
    filtering would mix their light, or where a width or height is odd.

    light:      (h, w, 3) float32
    has_patch:  (h, w) bool, texels of charts
    """
    levels, charts = [light], np.zeros(has_patch.shape, np.int64)
    charts[has_patch] = connected_texels(has_patch[None]) + 1
    while not any(size % 2 for size in charts.shape):
        blocks = _blocks(charts)
        coarse = blocks.max(axis=2)
        if (((blocks > 0) & (blocks != coarse[..., None])).any()) or _touch(coarse):
            break
        below = _blocks(levels[-1])
        weights = np.where(coarse[..., None] > 0, blocks > 0, True).astype(np.float32)
        mean = np.einsum("yxkc,yxk->yxc", below, weights) / weights.sum(axis=2, keepdims=True)
        levels.append(_with_gutter(mean.astype(np.float32), coarse > 0))
        charts = coarse
    return levels


def _blocks(texels: np.ndarray) -> np.ndarray:
    """Return the four texels below each texel of the next level, (h, w, ...) -> (h / 2, w / 2, 4, ...)."""
    return np.stack([texels[y::2, x::2] for y in (0, 1) for x in (0, 1)], axis=2)


def _touch(charts: np.ndarray) -> bool:
    """Return True if two neighboring texels belong to different charts, (h, w) int64; 0 for none."""
    pairs = ((charts[1:], charts[:-1]), (charts[:, 1:], charts[:, :-1]))
    return any(((one > 0) & (other > 0) & (one != other)).any() for one, other in pairs)


def _with_gutter(light: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return light, (h, w, 3), in which texels next to known ones repeat the light of one of these."""
    filled, done = light.copy(), known.copy()
    for axis, step in _NEIGHBORS:
        there = np.roll(known, step, axis)
        edge = [slice(None), slice(None)]
        edge[axis] = slice(0, 1) if step > 0 else slice(-1, None)
        there[tuple(edge)] = False
        new = there & ~done
        filled[new] = np.roll(light, step, axis)[new]
        done |= new
    return filled
