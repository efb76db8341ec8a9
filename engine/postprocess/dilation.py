"""Dilation of charts into empty texels, so that bilinear lookups at borders read no black (paper, VI.B)."""

from __future__ import annotations

import numpy as np

_NEIGHBOURS = np.array([(dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if (dy, dx) != (0, 0)])


class Dilation:
    """Fill of unknown texels ring by ring, each with the mean of its known neighbours.

    The neighbours are computed once; `fill` may be called for the image of each iteration.

    known:    (h, w) bool, texels that keep their bits
    texels:   number of rings
    surface:  (h, w) bool, known texels that lie on a chart; all of `known` by default. A texel with such
              neighbours averages only these, since the other known texels may be fitted to another chart
    """

    def __init__(self, known: np.ndarray, texels: int, surface: np.ndarray | None = None) -> None:
        self._unknown = np.flatnonzero(~known)
        self._rings: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        known = known.copy()
        for _ in range(texels):
            ring = np.flatnonzero(grown(known) & ~known)
            if not len(ring):
                break
            self._rings.append(_ring_neighbours(ring, known, known if surface is None else surface))
            known.ravel()[ring] = True

    def fill(self, image: np.ndarray) -> None:
        """Fill the unknown texels of a contiguous (h, w, c) float32 image; 0 beyond the rings."""
        flat = image.reshape(-1, image.shape[2])
        flat[self._unknown] = 0
        for texels, neighbours, weights in self._rings:
            flat[texels] = np.einsum("tk,tkc->tc", weights, flat.take(neighbours, axis=0))


def grown(mask: np.ndarray) -> np.ndarray:
    """Return the mask dilated by one texel in all eight directions."""
    rows = mask.copy()
    rows[1:] |= mask[:-1]
    rows[:-1] |= mask[1:]
    grown = rows.copy()
    grown[:, 1:] |= rows[:, :-1]
    grown[:, :-1] |= rows[:, 1:]
    return grown


def _ring_neighbours(
    ring: np.ndarray, known: np.ndarray, surface: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a ring's flat indices, (t,), its eight neighbours, (t, 8), and their weights, (t, 8) float32."""
    height, width = known.shape
    y, x = (start[:, None] + step for start, step in zip(np.divmod(ring, width), _NEIGHBOURS.T, strict=True))
    inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
    neighbours = np.where(inside, y * width + x, 0)
    nearest, others = (inside & mask.ravel()[neighbours] for mask in (surface, known))
    weights = np.where(nearest.any(axis=1, keepdims=True), nearest, others).astype(np.float32)
    return ring, neighbours, weights / weights.sum(axis=1, keepdims=True)
