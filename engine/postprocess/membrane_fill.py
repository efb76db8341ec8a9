"""Membrane fill of image holes: pull-push with Jacobi relaxation at each scale."""

from __future__ import annotations

import numpy as np

#: Jacobi relaxations at each scale.
_RELAXATIONS = 4


class MembraneFill:
    """Fill of unknown texels with a smooth membrane over the known ones.

    Coarser images hold the means of known texels. On the way back each finer image interpolates its unknown
    texels (pull-push: Gortler et al. 1996, section 3.4). Jacobi steps of the Laplace equation then smooth
    them. Indices and weights are computed once and serve for any number of images.

    known:   (h, w) bool, texels that keep their bits
    filled:  (h, w) bool, texels to fill; all others become 0. If no texel is known, these become 0 too
    """

    def __init__(self, known: np.ndarray, filled: np.ndarray) -> None:
        self._empty = np.flatnonzero(~known & ~(filled & known.any()))
        self._scales: list[_Scale] = []
        while known.any() and (~known & filled).any():
            self._scales.append(_Scale(known, filled))
            known = _blocks(known).any(axis=(1, 3))
            filled = np.ones_like(known)

    def fill(self, image: np.ndarray) -> None:
        """Fill a contiguous (h, w, c) float32 image in place."""
        image.reshape(-1, image.shape[2])[self._empty] = 0
        images = [image]
        for scale in self._scales:
            images.append(scale.coarser(images[-1]))
        for scale, fine, coarse in reversed(list(zip(self._scales, images[:-1], images[1:], strict=True))):
            scale.extend(fine, coarse)


class _Scale:
    """One scale of the image pyramid: restriction to the next coarser scale and interpolation from it.

    known, filled:  (h, w) bool
    """

    def __init__(self, known: np.ndarray, filled: np.ndarray) -> None:
        self._known = known[:, :, None].astype(np.float32)
        count = _blocks(self._known).sum(axis=(1, 3))
        self._weight = np.divide(1, count, out=np.zeros_like(count), where=count > 0)
        self._unknown = np.flatnonzero(~known & filled)
        self._taps, self._weights = _coarse_taps(self._unknown, known.shape)
        self._neighbours = _neighbours(self._unknown, known | filled)

    def coarser(self, image: np.ndarray) -> np.ndarray:
        """Return the next coarser image, (h', w', c) float32: means of the known texels of 2 x 2 blocks."""
        coarse: np.ndarray = _blocks(image * self._known).sum(axis=(1, 3)) * self._weight
        return coarse

    def extend(self, image: np.ndarray, coarse: np.ndarray) -> None:
        """Interpolate the unknown texels from the coarser image, then relax them."""
        texels = image.reshape(-1, image.shape[2])
        taps = coarse.reshape(-1, image.shape[2])[self._taps]
        texels[self._unknown] = np.einsum("tk,tkc->tc", self._weights, taps)
        for _ in range(_RELAXATIONS):
            texels[self._unknown] = texels[self._neighbours].mean(axis=1)


def _blocks(image: np.ndarray) -> np.ndarray:
    """Return an image, (h, w, ...), as 2 x 2 blocks, (h', 2, w', 2, ...), padded with 0."""
    height, width = image.shape[:2]
    padded = np.pad(image, [(0, height % 2), (0, width % 2), *[(0, 0)] * (image.ndim - 2)])
    return padded.reshape((height + 1) // 2, 2, (width + 1) // 2, 2, *image.shape[2:])


def _coarse_taps(texels: np.ndarray, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return the four coarse texels around each fine one, (t, 4) flat indices, and their float32 weights."""
    height, width = ((size + 1) // 2 for size in shape)
    row, column = np.divmod(texels, shape[1])

    # Bilinear interpolation between cell centres: on each axis the nearer block has weight 3/4, the farther
    # 1/4.
    rows = np.stack([row // 2, np.clip(row // 2 + 2 * (row % 2) - 1, 0, height - 1)], axis=1)
    columns = np.stack([column // 2, np.clip(column // 2 + 2 * (column % 2) - 1, 0, width - 1)], axis=1)
    taps = (rows[:, :, None] * width + columns[:, None, :]).reshape(-1, 4)
    weights = np.array([9, 3, 3, 1], np.float32) / 16
    return taps, np.broadcast_to(weights, taps.shape)


def _neighbours(texels: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Return the four neighbours of texels, (t, 4) flat indices; a missing neighbour is the texel itself."""
    row, column = np.divmod(texels, there.shape[1])
    neighbours = []
    for down, right in ((-1, 0), (1, 0), (0, -1), (0, 1)):
        y = np.clip(row + down, 0, there.shape[0] - 1)
        x = np.clip(column + right, 0, there.shape[1] - 1)
        neighbours.append(np.where(there[y, x], y * there.shape[1] + x, texels))
    return np.stack(neighbours, axis=1)
