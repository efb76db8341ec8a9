"""Strands of hair as flat ribbons with two sides, whose mean width from all sides is that of the strand."""

from __future__ import annotations

import numpy as np

from .meshes import Corners
from .strands import Strands

#: Half the width of a ribbon around a strand of radius 1. Turned about the strand at random, a ribbon looks
#: 2 / pi of its width wide on the mean (Cauchy).
_HALF = np.pi / 2

#: Length by which ribbons begin off the root, in radii, so that they do not cut the texels below them.
_LIFT = 0.1

#: Triangles of a piece between two points.
_TRIANGLES = 4


def thin_out(strands: Strands, most: int) -> Strands:
    """Return as many strands, chosen at random, as need at most `most` triangles; wider in return.

    On the mean their shadow is that of all strands (Cook et al., "Stochastic Simplification of Aggregate
    Detail", 2007).
    """
    total = count_triangles(strands)
    if total <= most:
        return strands
    count = len(strands.starts) - 1
    kept = max(int(count * most / total), 1)
    chosen = np.sort(np.random.default_rng(count).permutation(count)[:kept])
    sizes = np.diff(strands.starts)[chosen]
    starts = np.r_[0, np.cumsum(sizes)]
    points = np.repeat(strands.starts[chosen] - starts[:-1], sizes) + np.arange(starts[-1])
    return Strands(strands.points[points], strands.radius[points] * (count / kept), starts, strands.slot)


def count_triangles(strands: Strands) -> int:
    """Return how many triangles the ribbons of strands have."""
    return _TRIANGLES * int(np.maximum(np.diff(strands.starts) - 1, 0).sum())


def make_ribbons(strands: Strands) -> Corners:
    """Return the triangles of ribbons along strands, object space, without those that have no area."""
    points = _lifted(strands)
    last = np.zeros(len(points), bool)
    last[strands.starts[1:][np.diff(strands.starts) > 0] - 1] = True
    first = np.flatnonzero(~last)
    offset = _HALF * strands.radius[:, None] * _across(strands)
    left, right = points - offset, points + offset
    front = np.stack([left[first], left[first + 1], right[first + 1], right[first]], axis=1)
    quads = np.stack([front, front[:, ::-1]], axis=1).reshape(-1, 4, 3).astype(np.float32)
    positions = quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
    cross = np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0])
    length = np.linalg.norm(cross, axis=1)
    kept = length > 0
    face = np.repeat(np.arange(len(quads), dtype=np.int32), 2)
    return Corners(
        positions=positions[kept],
        normals=np.repeat((cross[kept] / length[kept, None])[:, None], 3, axis=1),
        uvs=None,
        texture_uvs={},
        face=face[kept],
        subface=np.tile(np.arange(2, dtype=np.int32), len(quads))[kept],
        slot=np.zeros(int(kept.sum()), np.int32),
        dropped=0,
    )


def _lifted(strands: Strands) -> np.ndarray:
    """Return the points of strands, (p, 3), the first of each a little off its root."""
    points = strands.points.copy()
    first = strands.starts[:-1][np.diff(strands.starts) > 1]
    step = points[first + 1] - points[first]
    length = np.linalg.norm(step, axis=1)
    part = np.minimum(_LIFT * strands.radius[first] / np.maximum(length, 1e-300), 0.5)
    points[first] += part[:, None] * step
    return points


def _across(strands: Strands) -> np.ndarray:
    """Return a unit vector across the strand at each point, (p, 3).

    Each strand has one random direction that these are made with, so that ribbons are not twisted.
    """
    along, sizes = _tangents(strands), np.diff(strands.starts)
    strand = np.repeat(np.arange(len(sizes)), sizes)
    random = np.random.default_rng(len(sizes)).normal(size=(len(sizes), 3))
    root = np.zeros((len(sizes), 3))
    root[sizes > 0] = along[strands.starts[:-1][sizes > 0]]
    normal = np.cross(root, random)[strand]
    across = _unit(np.cross(along, normal))
    bare = (across == 0).all(axis=1)
    across[bare] = _unit(np.cross(along[bare], np.eye(3)[np.abs(along[bare]).argmin(axis=1)]))
    return across


def _tangents(strands: Strands) -> np.ndarray:
    """Return the unit tangent of each point, (p, 3): along the chord between its neighbours."""
    points, count = strands.points, len(strands.points)
    before, after = np.arange(count) - 1, np.arange(count) + 1
    filled = np.diff(strands.starts) > 0
    before[strands.starts[:-1][filled]] += 1
    after[strands.starts[1:][filled] - 1] -= 1
    return _unit(points[after] - points[before])


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Return unit vectors, (n, 3); 0 stays 0."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    unit: np.ndarray = vectors / np.maximum(length, 1e-300)
    return unit
