"""Image texture of a material."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


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
