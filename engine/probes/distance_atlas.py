"""Atlas of the octahedral maps of distances around probes, with borders for bilinear filters."""

from __future__ import annotations

import numpy as np

#: Texels along each side of an octahedral map of distances, as in kernels/probes/probe_distances.cl.
MAP_WIDTH = 8

#: Texels around each map, and width of a map with them.
BORDER = 1
TILE = MAP_WIDTH + 2 * BORDER


def distance_atlas(distances: np.ndarray, resolution: tuple[int, int, int]) -> np.ndarray:
    """Return the atlas of maps, (10 ny nz, 10 nx, 3) float32, bottom row first.

    The map of probe (i, j, k) is the tile in column i and row k ny + j, counted from the bottom left. R is
    the mean distance, m, G the mean squared distance, m^2, and B is 0. Borders repeat the texels beyond the
    edges of the octahedral map, so that bilinear filters are continuous (Majercik et al. 2019).

    distances:  (n, 8, 8, 2) float32, see `ProbeGrid`
    """
    x, y, z = resolution
    tiles = np.zeros((z * y, x, TILE, TILE, 3), np.float32)
    u, v = _wrapped()
    tiles[..., :2] = distances[:, v, u].reshape(z * y, x, TILE, TILE, 2)
    return tiles.swapaxes(1, 2).reshape(z * y * TILE, x * TILE, 3)


def _wrapped() -> tuple[np.ndarray, np.ndarray]:
    """Return the texels of a map, u and v, (10, 10) int64 each, for all texels of a tile."""
    place = np.arange(TILE) - BORDER
    u, v = np.meshgrid(place, place)

    # Beyond a side, the map goes on at the mirror image of the side; beyond a corner, at the opposite one.
    last = MAP_WIDTH - 1
    beyond_u, beyond_v = (axis != np.clip(axis, 0, last) for axis in (u, v))
    inner_u, inner_v = np.clip(u, 0, last), np.clip(v, 0, last)
    return np.where(beyond_v, last - inner_u, inner_u), np.where(beyond_u, last - inner_v, inner_v)
