"""Long lists as array textures for shader look-ups, in row-major order."""

from __future__ import annotations

import moderngl
import numpy as np

#: Width of the texture, texels, as in transmission.glsl, and its maximum height. Every OpenGL 4.1 driver
#: supports this size, and enough layers for any int32 index.
_WIDTH = 4096
HEIGHT = 16384


def table(context: moderngl.Context, values: np.ndarray) -> moderngl.TextureArray:
    """Return a list, (k,) or (k, 4) of uint16, int32 or float32, as (layers, height, width[, 4])."""
    rows = -(-len(values) // _WIDTH)
    layers = -(-rows // HEIGHT)
    height = -(-rows // layers)
    texels = np.zeros((layers * height * _WIDTH, *values.shape[1:]), values.dtype)
    texels[: len(values)] = values
    components = values.shape[1] if values.ndim > 1 else 1
    kind = f"{values.dtype.kind}{values.dtype.itemsize}"
    return context.texture_array((_WIDTH, height, layers), components, texels, dtype=kind)
