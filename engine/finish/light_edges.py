"""Texels on an edge of light, or of what is seen: they show more than what is at their centre."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.buffers import download, upload, zeros
from ..device.compute import Compute
from ..patches.texels_around import cells_around

#: Light has an edge where it differs from the mean of its neighbours by more than this part.
_EDGE = 0.1

#: At the border of a chart light may have an edge between the centre of a texel and its end, which no other
#: centre shows. Light around the texel that differs from the mean of its neighbours by this part tells of it.
_EDGE_NEAR_BORDER = 0.05

#: Light below this part of the map's mean counts as if it were that bright.
_DARK = 0.05

#: Edges stand out from noise, which is told in blocks of this many texels squared: dark corners have more of
#: it than what sees the sky. A part of a block at least has no edges; they stand out by this many times the
#: largest difference there, which for a quarter is 0.67 standard deviations of normal noise.
_BLOCK, _EVEN, _ABOVE_NOISE = 16, 0.25, 4.0

#: Marks of kernels/edges.cl.
_ON_EDGE, _AT_AN_END, _AT_A_BORDER = 1, 2, 4


@dataclass(frozen=True)
class PatchLight:
    """What is known of patches once the light has settled, (n, ...) each.

    light   (n,) float32, all light, sum of the channels
    front   (n,) float32, the fraction of the view that no back takes
    hidden  (n,) bool, nobody sees the patch
    """

    light: np.ndarray
    front: np.ndarray
    hidden: np.ndarray


def find_edges(compute: Compute, entries: np.ndarray, known: PatchLight) -> tuple[np.ndarray, np.ndarray]:
    """Return texels on an edge, and those at an end of their chart along an axis, two (atlases, r, r) bool.

    entries  (atlases, r, r) uint32, the patch + 1 of each texel; 0 for none, which is at an end

    An edge is where light or the backs in view are not the mean of the neighbours', and both sides of a
    border of what is hidden. Light around a texel at the border of its chart that is less even than elsewhere
    is one, too: a shadow may end on the way from the centre to the border. Both have to stand out from the
    noise nearby, so that bakes of few rays do not take noise for edges.
    """
    (kernel,) = compute.kernels(("texel.cl", "edges.cl"), "find_edges")
    off, marks = zeros(compute, 4 * entries.size), zeros(compute, 4 * (entries.size // 4 + 1))
    values = (values.astype(np.float32, copy=False) for values in (known.light, known.front))
    least = np.float32(_DARK * float(known.light.mean()))
    buffers = [upload(compute, array) for array in (entries, *values, known.hidden.view(np.uint8))]
    compute.run_texels(kernel, entries.shape, *buffers, least, off, marks)
    found = download(compute, marks, (entries.size // 4 + 1,)).view(np.uint8)[: entries.size]
    found = found.reshape(entries.shape)
    steps = download(compute, off, entries.shape)
    noise = _noise(steps, entries)
    edge = _above(steps, np.maximum(_EDGE, noise)) | (found & _ON_EDGE > 0)
    border = np.flatnonzero(found & _AT_A_BORDER)
    around = cells_around(steps, border).max(axis=1, initial=0)
    least = np.maximum(_EDGE_NEAR_BORDER, noise)[_block_of(border, entries.shape[1])]
    edge.ravel()[border[around > least]] = True
    return edge, found & _AT_AN_END > 0


def _noise(steps: np.ndarray, entries: np.ndarray) -> np.ndarray:
    """Return by how much steps of light differ by noise in each block of texels, (atlases, b, b) float32.

    steps, entries: (atlases, r, r), of which every second row and column is looked at
    """
    some = np.where(entries[:, ::2, ::2] > 0, steps[:, ::2, ::2], np.float32(np.inf))
    side, atlases = _BLOCK // 2, len(steps)
    blocks = -(-some.shape[1] // side)
    rest = blocks * side - some.shape[1]
    some = np.pad(some, ((0, 0), (0, rest), (0, rest)), constant_values=np.inf)

    # Texels without a patch are infinitely uneven, so that they come last of their block.
    some = some.reshape(atlases, blocks, side, blocks, side).swapaxes(2, 3)
    some = np.sort(some.reshape(atlases, blocks, blocks, side * side), axis=3)
    place = (_EVEN * np.isfinite(some).sum(axis=3)).astype(np.int64)
    found = np.take_along_axis(some, place[..., None], axis=3)[..., 0]
    noise: np.ndarray = np.where(np.isfinite(found), _ABOVE_NOISE * found, 0).astype(np.float32)
    return noise


def _above(steps: np.ndarray, least: np.ndarray) -> np.ndarray:
    """Return where steps, (atlases, r, r), are above the limit of their block, (atlases, b, b)."""
    width = steps.shape[1]
    above = np.empty(steps.shape, bool)
    for row, limits in enumerate(least.swapaxes(0, 1)):
        rows = slice(row * _BLOCK, min((row + 1) * _BLOCK, width))
        np.greater(steps[:, rows], limits.repeat(_BLOCK, axis=1)[:, None, :width], out=above[:, rows])
    return above


def _block_of(texel: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the atlas, the row and the column of the block of texels, flat indices."""
    row, column = np.divmod(texel, width)
    atlas, row = np.divmod(row, width)
    return atlas, row // _BLOCK, column // _BLOCK
