"""Hemicubes: unfolded layout, multiplier map, random rotations and view matrices.

The unfolded layout of a hemicube of width N (paper, Fig. 2, right) is N wide and 3N tall, with row 0 at the
bottom as in OpenGL. Each side face is the half of a cube face above the patch's plane:

    rows 0    ... N       top, looking along the normal; x along `right`, y along `up`
    rows N    ... 1.5 N   side along +right
    rows 1.5N ... 2 N     side along -right
    rows 2N   ... 2.5 N   side along +up
    rows 2.5N ... 3 N     side along -up; in each side x runs along normal x direction, y along normal
"""

from __future__ import annotations

import numpy as np

#: Faces of a hemicube in the order of the layout.
FACES = 5


def face_rows(n: int) -> list[tuple[int, int]]:
    """Return (first row, number of rows) of each face in the layout of width n."""
    half = n // 2
    return [(0, n)] + [(n + side * half, half) for side in range(4)]


def multiplier_map(n: int) -> np.ndarray:
    """Return the cosine-weighted solid angle of each hemicube texel, divided by pi.

    Shape (3n, n) float32 with sum 1: the exact integral of the delta form factors of Cohen & Greenberg 1985
    over each texel, by inclusion-exclusion of their antiderivatives.
    """
    edges = np.linspace(-1.0, 1.0, n + 1)
    heights = np.linspace(0.0, 1.0, n // 2 + 1)
    top = _texel_integrals(_top_antiderivative(edges[None, :], edges[:, None]))
    side = _texel_integrals(_side_antiderivative(edges[None, :], heights[:, None]))
    return np.concatenate([top, side, side, side, side]).astype(np.float32)


def _top_antiderivative(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the form factor of the rectangle (0, 0)-(x, y) of the top face, at height 1."""
    a, b = np.sqrt(1 + x * x), np.sqrt(1 + y * y)
    return (x / a * np.arctan(y / a) + y / b * np.arctan(x / b)) / (2 * np.pi)


def _side_antiderivative(y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the form factor of the rectangle (0, 0)-(y, z) of a side face, at distance 1."""
    a = np.sqrt(1 + z * z)
    return (np.arctan(y) - np.arctan(y / a) / a) / (2 * np.pi)


def _texel_integrals(corner: np.ndarray) -> np.ndarray:
    """Return differences of an antiderivative sampled at the (rows + 1, columns + 1) texel corners."""
    return corner[1:, 1:] - corner[1:, :-1] - corner[:-1, 1:] + corner[:-1, :-1]


def rotations(seed: int, ids: np.ndarray) -> np.ndarray:
    """Return a pseudo-random angle for each patch; equal seeds and ids give equal angles.

    ids: (n,) integer patch indices. Returns (n,) float64, radians in [-pi, pi) (paper, IV.B). The hash is
        lowbias32 (Wellons 2018) of index and seed.
    """
    mixed = _hash32(ids.astype(np.uint32) ^ rotation_salt(seed))
    return (mixed / 2.0**32 * 2.0 - 1.0) * np.pi


def rotation_salt(seed: int) -> np.uint32:
    """Return a hash of the seed that is combined with patch indices."""
    salt: np.uint32 = _hash32(np.array([(seed + 1) & 0xFFFFFFFF], np.uint32))[0]
    return salt


def _hash32(x: np.ndarray) -> np.ndarray:
    x = x ^ (x >> np.uint32(16))
    x = x * np.uint32(0x7FEB352D)
    x = x ^ (x >> np.uint32(15))
    x = x * np.uint32(0x846CA68B)
    return x ^ (x >> np.uint32(16))


def frames(normal: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return the axes right, up and normal of each hemicube, rotated about the normal.

    normal: (n, 3) unit, world space; angle: (n,) radians. Returns (n, 3, 3) float64, rows right, up, normal
        with right x up = normal. Basis from a normal: Duff et al. 2017.
    """
    x, y, z = normal.astype(np.float64).T
    sign = np.where(z < 0, -1.0, 1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    right = np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=1)
    up = np.stack([b, sign + y * y * a, -y], axis=1)
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return np.stack([cos * right + sin * up, cos * up - sin * right, np.stack([x, y, z], axis=1)], axis=1)


def face_axes(frame: np.ndarray) -> np.ndarray:
    """Return (right, up, forward) of the five faces of each hemicube.

    frame: (n, 3, 3) from `frames`. Returns (n, 5, 3, 3) float64; on every face right x up = forward.
    """
    axes = np.empty((len(frame), FACES, 3, 3))
    axes[:, 0] = frame
    axes[:, 1:, 1] = frame[:, None, 2]
    right, up = frame[:, 0], frame[:, 1]
    for face, across, forward in ((1, up, right), (2, -up, -right), (3, -right, up), (4, right, -up)):
        axes[:, face, 0], axes[:, face, 2] = across, forward
    return axes


def matrices(frame: np.ndarray, eye: np.ndarray, near: np.ndarray, reversed_depth: bool) -> np.ndarray:
    """Return the world-to-clip matrix of every face of every hemicube.

    frame: (n, 3, 3) from `frames`; eye: (n, 3) world space; near: (n,) distance of the near plane, metres.
        Returns (n, 5, 4, 4) float32, indexed [row, column], for column vectors. The far plane is at infinity;
        depth is near / distance if reversed_depth, else 1 - 2 near / distance. Only the upper half of a side
        face is drawn: y = 2 v - w for height v and distance w.
    """
    axes = face_axes(frame)
    clip = np.empty((len(frame), FACES, 4, 4))
    x, y, z, w = np.moveaxis(clip, 2, 0)
    for row, axis in ((x, 0), (y, 1), (w, 2)):
        row[..., :3] = axes[:, :, axis]
        row[..., 3] = -(axes[:, :, axis] @ eye.astype(np.float64)[:, :, None])[..., 0]
    y[:, 1:] = 2 * y[:, 1:] - w[:, 1:]
    z[...] = 0 if reversed_depth else w
    z[..., 3] += (near if reversed_depth else -2 * near)[:, None]
    return clip.astype(np.float32)
