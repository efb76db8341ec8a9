"""Grows charts into the empty texels around them, so that interpolation meets no black (paper, VI.B)."""

from __future__ import annotations

import numpy as np

_NEIGHBOURS = np.array([(dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if (dy, dx) != (0, 0)])


class Dilation:
    """Fills unknown texels one ring at a time, each with the mean of its known neighbours.

    known   (h, w) bool, texels that keep their bits
    texels  number of rings
    The neighbours are found once; `apply` may be called for every iteration's image.
    """

    def __init__(self, known: np.ndarray, texels: int) -> None:
        self._known = known
        self._rings: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        padded = np.pad(known, 1)
        for _ in range(texels):
            ring = np.flatnonzero(_grown(padded) & ~padded)
            ring = ring[_inside(ring, padded.shape)]
            if not len(ring):
                break
            self._rings.append(_ring_neighbours(ring, padded))
            padded.ravel()[ring] = True

    def apply(self, image: np.ndarray) -> np.ndarray:
        """Return a copy of an (h, w, c) float32 image with its unknown texels filled."""
        filled = np.pad(np.where(self._known[..., None], image, np.float32(0)), ((1, 1), (1, 1), (0, 0)))
        flat = filled.reshape(-1, image.shape[2])
        for texels, neighbours, weights in self._rings:
            flat[texels] = np.einsum("tk,tkc->tc", weights, flat[neighbours])
        return filled[1:-1, 1:-1].copy()


def _grown(mask: np.ndarray) -> np.ndarray:
    """Return the mask grown by one texel in all eight directions; its border row stays as it is."""
    rows = mask.copy()
    rows[1:] |= mask[:-1]
    rows[:-1] |= mask[1:]
    grown = rows.copy()
    grown[:, 1:] |= rows[:, :-1]
    grown[:, :-1] |= rows[:, 1:]
    return grown


def _inside(texels: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """True for flat indices that are not in the one-texel padding."""
    y, x = np.divmod(texels, shape[1])
    inside: np.ndarray = (y > 0) & (y < shape[0] - 1) & (x > 0) & (x < shape[1] - 1)
    return inside


def _ring_neighbours(ring: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the ring's flat indices, their (t, 8) neighbours and the (t, 8) float32 weights."""
    neighbours = ring[:, None] + _NEIGHBOURS[:, 0] * known.shape[1] + _NEIGHBOURS[:, 1]
    weights = known.ravel()[neighbours].astype(np.float32)
    return ring, neighbours, weights / weights.sum(axis=1, keepdims=True)
