"""Mip levels of a lightmap that mix no light of different charts."""

from __future__ import annotations

import numpy as np

from ..patches.texel_components import connected_texels

#: Shifts to the four neighbors of a texel: axis and direction.
_NEIGHBORS = ((0, 1), (0, -1), (1, 1), (1, -1))


def chart_mips(light: np.ndarray, has_patch: np.ndarray) -> list[np.ndarray]:
    """Return the mip levels of a lightmap, the lightmap first, down to one texel; each (h, w, 3) float32.

    Of the four texels below a texel, those of the most frequent chart are averaged. Texels next to a chart
    repeat its light.

    light:      (h, w, 3) float32
    has_patch:  (h, w) bool, texels of charts
    """
    levels, charts = [light], np.zeros(has_patch.shape, np.int64)
    charts[has_patch] = connected_texels(has_patch[None]) + 1
    while max(charts.shape) > 1:
        blocks, below = _blocks(charts), _blocks(levels[-1])
        equal = (blocks[..., None] == blocks[:, :, None]) & (blocks[..., None] > 0)
        most = equal.sum(axis=3).argmax(axis=2)[..., None]
        charts = np.take_along_axis(blocks, most, axis=2)[..., 0]
        weights = (blocks == charts[..., None]).astype(np.float32)
        mean = np.einsum("yxkc,yxk->yxc", below, weights) / weights.sum(axis=2, keepdims=True)
        levels.append(_with_gutter(mean.astype(np.float32), charts > 0))
    return levels


def _blocks(texels: np.ndarray) -> np.ndarray:
    """Return the four texels below each texel of the next level, (h, w, ...) -> (h // 2, w // 2, 4, ...).

    The last row or column of an odd size is left out, and a single one is repeated.
    """
    for axis in (0, 1):
        if texels.shape[axis] == 1:
            texels = np.repeat(texels, 2, axis)
    height, width = (size // 2 * 2 for size in texels.shape[:2])
    return np.stack([texels[y:height:2, x:width:2] for y in (0, 1) for x in (0, 1)], axis=2)


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
