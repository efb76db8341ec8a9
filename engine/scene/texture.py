"""Image texture of a material, and its lookup on the host."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .color import srgb_to_linear


@dataclass(frozen=True)
class Texture:
    """Image texture of a material, with its mapping and interpolation.

    pixels:     (h, w, c) float32, c is 1 or 3; scene-linear unless `srgb`; row 0 at v = 0
    uv_map:     key into `Mesh.texture_uvs`
    transform:  (2, 3) float64, applied to (u, v, 1) of the UV map; the image covers [0, 1]
    extension:  value outside [0, 1]: "repeat", "mirror", "extend" (edge pixel) or "clip" (zero)
    smooth:     True for bilinear interpolation, False for the nearest pixel
    srgb:       True if pixels are sRGB-encoded; decoded after interpolation, as Cycles does for 8-bit images
    """

    name: str
    pixels: np.ndarray
    uv_map: str
    transform: np.ndarray = field(default_factory=lambda: np.eye(2, 3))
    extension: str = "repeat"
    smooth: bool = True
    srgb: bool = False


def sample(pixels: np.ndarray, uv: np.ndarray, texture: Texture) -> np.ndarray:
    """Look up a texture at points, (m, 2), by its interpolation and extension; return (m, c) float64.

    pixels:  (h, w, c) float32, `texture.pixels` or a reduced version
    uv:      (m, 2) texture coordinates
    """
    height, width = pixels.shape[:2]
    pixel = uv.astype(np.float64) * (width, height) - (0.5 if texture.smooth else 0.0)
    low = np.floor(pixel).astype(np.int64)
    if not texture.smooth:
        nearest = _pixel(pixels, low[:, 0], low[:, 1], texture.extension)
        return srgb_to_linear(nearest) if texture.srgb else nearest
    x, y = (pixel - low).T[:, :, None]
    columns, rows = low.T
    values: np.ndarray = (
        _pixel(pixels, columns, rows, texture.extension) * ((1 - x) * (1 - y))
        + _pixel(pixels, columns + 1, rows, texture.extension) * (x * (1 - y))
        + _pixel(pixels, columns, rows + 1, texture.extension) * ((1 - x) * y)
        + _pixel(pixels, columns + 1, rows + 1, texture.extension) * (x * y)
    )
    return srgb_to_linear(values) if texture.srgb else values


def _pixel(pixels: np.ndarray, x: np.ndarray, y: np.ndarray, extension: str) -> np.ndarray:
    """Return pixels at integer coordinates, (m, c) float64, by the extension mode beyond the edge."""
    height, width = pixels.shape[:2]
    values = pixels[_wrap(y, height, extension), _wrap(x, width, extension)].astype(np.float64)
    if extension == "clip":
        values[(x < 0) | (x >= width) | (y < 0) | (y >= height)] = 0
    return values


def _wrap(index: np.ndarray, size: int, extension: str) -> np.ndarray:
    """Apply the extension mode to row or column indices, so that they lie within the image."""
    if extension == "repeat":
        return index % size
    if extension == "mirror":
        folded = index % (2 * size)
        return np.minimum(folded, 2 * size - 1 - folded)
    return np.clip(index, 0, size - 1)
