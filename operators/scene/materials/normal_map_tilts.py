"""Histograms of the tilt of a normal map's normals, cached from one bake to the next."""

from __future__ import annotations

import hashlib
import os
from collections import OrderedDict

import bpy
import numpy as np

from ....engine.scene.color import srgb_to_linear

#: Number of histogram bins for the z component of unit normals, from 0 to 1.
CLASSES = 256

#: Largest number of cached histograms.
_KEPT = 1024


def count_tilts(colours: np.ndarray, srgb: bool) -> np.ndarray:
    """Return the histogram of the normals' z components in a normal map's colours, (CLASSES,) int64.

    Normals that point into the surface, or have no direction, are in the first bin.

    colours:  (..., 3) float32
    srgb:     True if the colours are sRGB-encoded
    """
    normals = 2 * (srgb_to_linear(colours) if srgb else colours).reshape(-1, 3) - 1
    length = np.sqrt(np.einsum("ij,ij->i", normals, normals))
    height = np.divide(normals[:, 2], length, out=np.zeros_like(length), where=length > 0)
    return np.bincount((np.clip(height, 0, 1) * (CLASSES - 1) + 0.5).astype(np.intp), minlength=CLASSES)


def heights_of(strength: float) -> np.ndarray:
    """Return the z component of each bin's normals at a Normal Map node's strength, (CLASSES,) float64.

    The strength scales the tangential components. A strength below 1 also mixes the z component with 1.
    """
    height = np.linspace(0, 1, CLASSES)
    along = strength * np.sqrt(1 - height**2)
    across = 1 + (height - 1) * min(strength, 1.0)
    length = np.hypot(along, across)
    return np.divide(across, length, out=np.zeros(CLASSES), where=length > 0)


class KeptTilts:
    """Least-recently-used cache of histograms by the state of the image."""

    def __init__(self) -> None:
        self._counts: OrderedDict[tuple, np.ndarray] = OrderedDict()

    def get(self, state: tuple | None) -> np.ndarray | None:
        """Return the histogram of an image's state, see `image_state`; None if it is not cached."""
        if state is None or state not in self._counts:
            return None
        self._counts.move_to_end(state)
        return self._counts[state]

    def keep(self, state: tuple | None, counts: np.ndarray) -> None:
        """Store the histogram of an image's state; do nothing if the state is unknown."""
        if state is not None:
            self._counts[state] = counts
            while len(self._counts) > _KEPT:
                self._counts.popitem(last=False)


def image_state(image: bpy.types.Image) -> tuple | None:
    """Return a key such that images with equal keys have equal pixels; None if unknown."""
    if image.source != "FILE" or image.is_dirty:
        return None
    if image.packed_file is not None:
        content: tuple = (hashlib.blake2b(image.packed_file.data).digest(),)
    else:
        path = bpy.path.abspath(image.filepath, library=image.library)
        try:
            status = os.stat(path)
        except OSError:
            return None
        content = (path, status.st_mtime_ns, status.st_size)
    return (*content, image.colorspace_settings.name, image.alpha_mode)


#: Histograms of this Blender session.
kept_tilts = KeptTilts()
