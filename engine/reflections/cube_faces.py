"""Geometry of cube maps: directions and solid angles of texels, borders, and the mip pyramid.

Faces are +x, -x, +y, -y, +z, -z of cube maps in OpenGL, Vulkan and KTX 2.0: left-handed axes with y up. A
world direction (X, Y, Z) of Blender looks up (X, Z, Y). Row 0 of a face is its top row.
"""

from __future__ import annotations

from functools import cache

import numpy as np

#: Axes of the faces in cube map axes: direction of the columns, of the rows, and outward (OpenGL 4.6, 8.13).
_FACES = np.array(
    [
        [(0, 0, -1), (0, -1, 0), (1, 0, 0)],
        [(0, 0, 1), (0, -1, 0), (-1, 0, 0)],
        [(1, 0, 0), (0, 0, 1), (0, 1, 0)],
        [(1, 0, 0), (0, 0, -1), (0, -1, 0)],
        [(1, 0, 0), (0, -1, 0), (0, 0, 1)],
        [(-1, 0, 0), (0, -1, 0), (0, 0, -1)],
    ],
    np.float64,
)

#: Cube map axes in world axes.
_TO_WORLD = [0, 2, 1]


def face_axes() -> np.ndarray:
    """Return columns, rows and outward direction of each face in world axes, (6, 3, 3) float64."""
    return _FACES[..., _TO_WORLD]


def cube_directions(size: int, border: int = 0) -> np.ndarray:
    """Return the unit directions of texel centres in world axes, (6, s, s, 3) float64, s = size + 2 border.

    border:  texels beyond the edges of each face, in its plane
    """
    steps = (2 * np.arange(-border, size + border) + 1) / size - 1
    columns, rows, outward = np.moveaxis(face_axes()[:, :, None, None], 1, 0)
    directions = columns * steps[:, None] + rows * steps[:, None, None] + outward
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    return directions


@cache
def texel_solid_angles(size: int) -> np.ndarray:
    """Return the solid angle of each texel of a face, (size, size) float64, sr; six faces sum to 4 pi."""
    edges = np.linspace(-1, 1, size + 1)
    x, y = edges[:, None], edges
    corners = np.arctan2(x * y, np.sqrt(x * x + y * y + 1))
    angles = np.diff(np.diff(corners, axis=0), axis=1)
    angles.setflags(write=False)
    return angles


def texels_of(directions: np.ndarray, size: int) -> np.ndarray:
    """Return the texel of a cube map in each direction, (...) int64: (face size + row) size + column.

    directions:  (..., 3) float, world axes, of any length
    """
    flat = np.asarray(directions, np.float64).reshape(-1, 3)
    along = np.einsum("nk,fak->nfa", flat, face_axes())
    face = along[..., 2].argmax(axis=1)
    s, t, outward = np.take_along_axis(along, face[:, None, None], axis=1)[:, 0].T
    column, row = (np.clip(((v / outward + 1) / 2 * size).astype(np.int64), 0, size - 1) for v in (s, t))
    texels: np.ndarray = ((face * size + row) * size + column).reshape(np.shape(directions)[:-1])
    return texels


@cache
def _bordered_texels(size: int) -> np.ndarray:
    """Return the nearest texel of a cube map for each texel of faces with a border, (6, s + 2, s + 2)."""
    return texels_of(cube_directions(size, 1), size)


def with_border(faces: np.ndarray) -> np.ndarray:
    """Return faces, (6, s, s, 3), with a border of one texel from the adjacent faces: (6, s + 2, s + 2, 3).

    Bilinear interpolation then is continuous across edges.
    """
    size = faces.shape[1]
    return faces.reshape(-1, 3)[_bordered_texels(size)]


def halved(faces: np.ndarray) -> np.ndarray:
    """Return faces, (6, s, s, 3) float32, at half the size: means weighted by solid angle."""
    size = faces.shape[1]
    angles = texel_solid_angles(size)[..., None]
    blocks = (6, size // 2, 2, size // 2, 2)
    sums = (faces * angles).reshape(*blocks, 3).sum(axis=(2, 4))
    means: np.ndarray = sums / angles.reshape((*blocks[1:], 1)).sum(axis=(1, 3))
    return means.astype(np.float32)


def mean_radiance(faces: np.ndarray) -> np.ndarray:
    """Return the mean radiance over all directions, (3,) float64, weighted by solid angle.

    faces:  (6, s, s, 3) float32, radiance
    """
    angles = texel_solid_angles(faces.shape[1])
    mean: np.ndarray = np.einsum("fyxc,yx->c", faces, angles) / (4 * np.pi)
    return mean
