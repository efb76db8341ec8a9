"""How far the normals of normal maps are tilted, kept from one bake to the next."""

from __future__ import annotations

import hashlib
import os
from collections import OrderedDict

import bpy
import numpy as np

from ....engine.scene.color import srgb_to_linear

#: Classes of the height of unit normals over the surface, from 0 to 1.
CLASSES = 256

#: Normal maps whose counts are kept.
_KEPT = 1024


def count_tilts(colours: np.ndarray, srgb: bool) -> np.ndarray:
    """Return how many normals of a normal map's colours are in each of CLASSES of height, int64.

    What points into the surface is in the first class, and so is what has no direction.

    colours  (..., 3) float32, encoded as sRGB if that is told
    """
    normals = 2 * (srgb_to_linear(colours) if srgb else colours).reshape(-1, 3) - 1
    length = np.sqrt(np.einsum("ij,ij->i", normals, normals))
    height = np.divide(normals[:, 2], length, out=np.zeros_like(length), where=length > 0)
    return np.bincount((np.clip(height, 0, 1) * (CLASSES - 1) + 0.5).astype(np.intp), minlength=CLASSES)


def heights_of(strength: float) -> np.ndarray:
    """Return the height of the normals of each class, (CLASSES,) float64, at a strength of a Normal Map node.

    It scales what lies along the surface, and below 1 mixes what stands on it with the surface's normal.
    """
    height = np.linspace(0, 1, CLASSES)
    along = strength * np.sqrt(1 - height**2)
    across = 1 + (height - 1) * min(strength, 1.0)
    length = np.hypot(along, across)
    return np.divide(across, length, out=np.zeros(CLASSES), where=length > 0)


class KeptTilts:
    """Counts of tilts by what the image is; those used longest ago are dropped first."""

    def __init__(self) -> None:
        self._counts: OrderedDict[tuple, np.ndarray] = OrderedDict()

    def get(self, state: tuple | None) -> np.ndarray | None:
        """Return what was counted in an image of a state, see `image_state`; None if nothing was."""
        if state in self._counts:
            self._counts.move_to_end(state)
        return self._counts.get(state)

    def keep(self, state: tuple | None, counts: np.ndarray) -> None:
        """Keep counts; those of no known state are not."""
        if state is not None:
            self._counts[state] = counts
            while len(self._counts) > _KEPT:
                self._counts.popitem(last=False)


def image_state(image: bpy.types.Image) -> tuple | None:
    """Return what an image's pixels depend on: equal ones have equal pixels. None if that is not known."""
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


#: Those of this Blender.
kept_tilts = KeptTilts()
