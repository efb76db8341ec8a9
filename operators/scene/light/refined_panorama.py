"""Renders worlds at a resolution that adapts to their detail: tiles that differ are rendered larger."""

from __future__ import annotations

import bpy
import numpy as np

from ....engine.scene.color import luminance
from ....engine.scene.sky_maps import row_fractions
from .panorama import Part, render_world

#: Rows of the successive renders, up to 8k; each map is twice as wide as high.
_ROWS = (512, 1024, 2048, 4096)

#: Maximum samples of a pixel, and of all pixels of a render; a render with that many takes a few seconds on
#: four cores.
_PIXEL_SAMPLES, _PICTURE_SAMPLES = 16, 1 << 23

#: Width of a tile in pixels of the first render, and relative difference from which on a tile is rendered
#: larger.
_TILE, _DIFFERENCE = 32, 0.01


def render_refined(world: bpy.types.World) -> np.ndarray:
    """Render a world's radiance as engine.Scene.world, (h, w, 3) float32; raises RuntimeError.

    Renders of 512 and 1024 rows are compared by the mean of each tile. If no tile differs, the map of 512
    rows is returned. Otherwise the map has 1024 rows. Tiles that differ are replaced by the means of larger
    renders until they no longer change.
    """
    coarse, fine = (_rendered(world, rows) for rows in _ROWS[:2])
    assert coarse is not None and fine is not None
    least, tile = _mean(coarse), _TILE * _ROWS[1] // _ROWS[0]
    differs = _differing(_shrunk(fine, 2), coarse, least, _TILE)
    if not differs.any():
        return coarse
    for rows in _ROWS[2:]:
        factor, part = rows // _ROWS[1], _around(differs, tile)
        picture = _rendered(world, rows, part.scaled(factor))
        if picture is None:
            break
        picture, shown, inside = _shrunk(picture, factor), fine[part.rows, part.columns], _tiles(part, tile)
        still = _differing(picture, shown, least, tile) & differs[inside]
        mask = np.repeat(np.repeat(differs[inside], tile, axis=0), tile, axis=1)
        shown[mask] = picture[mask]
        differs[inside] = still
        if not still.any():
            break
    return fine


def _rendered(world: bpy.types.World, rows: int, part: Part | None = None) -> np.ndarray | None:
    """Render a map or a part of it; None if that takes too many samples."""
    whole = Part(slice(0, rows), slice(0, 2 * rows))
    samples = min(_PICTURE_SAMPLES // (part or whole).pixels, _PIXEL_SAMPLES)
    return render_world(world, rows, samples, part) if samples else None


def _mean(world: np.ndarray) -> float:
    """Return the mean luminance of an equirectangular map over the sphere."""
    return float((luminance(world, np.float64).mean(axis=1) * row_fractions(len(world))).sum())


def _shrunk(picture: np.ndarray, factor: int) -> np.ndarray:
    """Downsample by the mean of squares of pixels, (h, w, 3) -> (h / factor, w / factor, 3) float32."""
    height, width = picture.shape[0] // factor, picture.shape[1] // factor
    return picture.reshape(height, factor, width, factor, 3).mean(axis=(1, 3), dtype=np.float32)


def _differing(picture: np.ndarray, other: np.ndarray, least: float, tile: int) -> np.ndarray:
    """Return a mask of tiles, (h / tile, w / tile) bool, whose mean differs in any channel.

    least:  smallest radiance to which a difference is relative, W/(m^2 sr)
    """
    means, others = _shrunk(picture, tile), _shrunk(other, tile)
    scale = np.maximum(np.maximum(np.abs(means), np.abs(others)), max(least, 1e-30))
    differs: np.ndarray = (np.abs(means - others) > _DIFFERENCE * scale).any(axis=2)
    return differs


def _around(tiles: np.ndarray, tile: int) -> Part:
    """Return the smallest rectangle of pixels with all tiles set in `tiles`, (h / tile, w / tile) bool."""
    rows, columns = np.flatnonzero(tiles.any(axis=1)), np.flatnonzero(tiles.any(axis=0))
    return Part(*(slice(tile * int(axis[0]), tile * (int(axis[-1]) + 1)) for axis in (rows, columns)))


def _tiles(part: Part, tile: int) -> tuple[slice, slice]:
    """Return the slices of tile rows and columns that a rectangle of pixels covers."""
    rows, columns = (slice(axis.start // tile, axis.stop // tile) for axis in (part.rows, part.columns))
    return rows, columns
