"""Conversion between Blender's scene-linear working space (a choice since 5.0) and linear Rec.709."""

from __future__ import annotations

import bpy
import mathutils
import numpy as np

from ..engine.array_ops import map_blocks
from ..engine.scene.color import luminance

REC709 = "Linear Rec.709"


def working_space() -> str:
    """Return the name of the working space; before Blender 5.0 it is always Rec.709."""
    spaces = getattr(bpy.data, "colorspace", None)
    return REC709 if spaces is None else str(spaces.working_space)


def is_rec709() -> bool:
    """Return True if the working space is Rec.709, as in files."""
    return working_space() == REC709


def _matrix() -> np.ndarray:
    """Return the (3, 3) float64 matrix from scene-linear colours to linear Rec.709."""
    columns = [mathutils.Color(axis).from_scene_linear_to_rec709_linear() for axis in np.eye(3)]
    return np.array(columns, np.float64).T


def to_rec709(colours: np.ndarray) -> np.ndarray:
    """Convert scene-linear colours (..., 3) to linear Rec.709, same dtype; may return the input array.

    Colours outside the Rec.709 gamut get negative channels.
    """
    return colours if is_rec709() else _product(colours, _matrix())


def from_rec709(colours: np.ndarray) -> np.ndarray:
    """Convert linear Rec.709 colours (..., 3) to scene-linear ones; may return the input array."""
    return colours if is_rec709() else _product(colours, np.linalg.inv(_matrix()))


def _product(colours: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return colours (..., 3) times a (3, 3) float64 matrix, same dtype; blocks limit float64 copies."""
    rows = colours.reshape(-1, 3)
    result: np.ndarray = np.empty_like(rows)

    def multiply(block: slice) -> None:
        result[block] = rows[block] @ matrix.T

    map_blocks(len(rows), 2 * result.itemsize * 3, multiply)
    return result.reshape(colours.shape)


def luminance_of(colours: np.ndarray) -> np.ndarray:
    """Return the luminance of scene-linear colours, (..., 3) float -> (...)."""
    return luminance(to_rec709(colours))
