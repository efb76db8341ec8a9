"""Light of vertices as glTF vertex colors."""

from __future__ import annotations

import copy

import numpy as np
from io_scene_gltf2.io.com import gltf2_io

from ..working_space import to_rec709

#: Name under which the exporter gathers the light; glTF requires that names of other attributes begin with _.
LIGHT = "_HEMIBAKE_LIGHT"

#: NumPy types of the component types of glTF colors: 8 and 16 bits normalised, and float.
_DTYPES = {5121: np.uint8, 5123: np.uint16, 5126: np.float32}


def light_colors(light: gltf2_io.Accessor, paint: gltf2_io.Accessor | None) -> gltf2_io.Accessor:
    """Return colors of vertices, RGBA float32, linear Rec.709: light, times painted colors if there are any.

    light:  RGBA float32, scene-linear
    paint:  RGB or RGBA colors of the same vertices; None without any
    """
    colors = _values(light).copy()
    colors[:, :3] = np.maximum(to_rec709(colors[:, :3]), 0)
    if paint is not None:
        values = _values(paint)
        colors[:, : values.shape[1]] *= values
    made = copy.copy(light)
    made.buffer_view = type(light.buffer_view)(colors.tobytes(), light.buffer_view.bufferViewTarget)
    return made


def _values(accessor: gltf2_io.Accessor) -> np.ndarray:
    """Return the values of an accessor, (n, 3 or 4) float32."""
    dtype = np.dtype(_DTYPES[int(accessor.component_type)])
    values = np.frombuffer(accessor.buffer_view.data, dtype).reshape(accessor.count, -1).astype(np.float32)
    return values if dtype.kind == "f" else values / (256**dtype.itemsize - 1)
