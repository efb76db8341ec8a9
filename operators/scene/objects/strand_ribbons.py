"""Converts strands of hair to flat two-sided ribbons, whose mean projected width equals the strand's."""

from __future__ import annotations

import numpy as np

from .meshes import Corners
from .strands import Strands

#: Half width of a ribbon for a strand of radius 1. The mean projected width of a ribbon in random orientation
#: is 2 / pi of its width (Cauchy).
_HALF = np.pi / 2

#: Length by which ribbons begin off the root, in radii. Rays of Cycles ignore ribbons nearer than two radii
#: (Embree, EMBREE_CURVE_SELF_INTERSECTION_AVOIDANCE_FACTOR). Of 0.1, 0.8, 1.4 and 1.8, measured on six
#: carpets, 0.8 has the least error: -11 % below thick black hair, within 6 % elsewhere.
_LIFT = 0.8

#: Minimum fraction of a strand that its ribbon covers.
_LEFT = 0.5

#: Triangles of a ribbon per segment between two points: two on each side.
_TRIANGLES = 4


def simplify_strands(strands: Strands, most: int) -> Strands:
    """Return a random subset of strands with at most `most` triangles, with larger radii in return.

    The mean shadow equals the shadow of all strands (Cook et al., "Stochastic Simplification of Aggregate
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
    radius = strands.radius[points] * (count / kept)
    return Strands(strands.points[points], radius, starts, strands.slot, widened=count / kept)


def count_triangles(strands: Strands) -> int:
    """Return the number of triangles of the ribbons of strands."""
    return _TRIANGLES * int(np.maximum(np.diff(strands.starts) - 1, 0).sum())


def make_ribbons(strands: Strands) -> Corners:
    """Return the triangles of ribbons along strands in object space, without zero-area triangles."""
    points, below = _lifted(strands)
    last = np.zeros(len(points), bool)
    last[strands.starts[1:][np.diff(strands.starts) > 0] - 1] = True
    first = np.flatnonzero(~last)
    first = first[~below[first + 1]]
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


def _lifted(strands: Strands) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of strands, (p, 3), and which lie below the start of their ribbon, (p,) bool.

    The latter are moved to that start.
    """
    points, sizes = strands.points, np.diff(strands.starts)
    filled = np.flatnonzero(sizes > 1)
    first, strand = strands.starts[:-1][filled], np.repeat(np.arange(len(sizes)), sizes)
    steps = np.zeros(len(points))
    steps[1:] = np.linalg.norm(np.diff(points, axis=0), axis=1)
    steps[strands.starts[:-1][sizes > 0]] = 0
    length = np.cumsum(steps)
    cut = np.full(len(sizes), -np.inf)
    cut[filled] = length[first] + np.minimum(
        _LIFT / strands.widened * strands.radius[first],
        (1 - _LEFT) * (length[strands.starts[1:][filled] - 1] - length[first]),
    )
    below = length < cut[strand]

    # The points below are the first ones of their strand, so the ribbon starts in front of the next point.
    after = first + np.add.reduceat(below, first)[: len(first)] if len(first) else first
    before = np.maximum(after - 1, first)
    part = (cut[filled] - length[before]) / np.maximum(length[after] - length[before], 1e-300)
    start = np.zeros((len(sizes), 3))
    start[filled] = points[before] + np.clip(part, 0, 1)[:, None] * (points[after] - points[before])
    return np.where(below[:, None], start[strand], points), below


def _across(strands: Strands) -> np.ndarray:
    """Return a unit vector across the strand at each point, (p, 3) float64.

    The vectors of a strand are made from one random direction, so that its ribbon is not twisted.
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
    """Return the unit tangent at each point, (p, 3) float64: along the chord between its neighbours."""
    points, count = strands.points, len(strands.points)
    before, after = np.arange(count) - 1, np.arange(count) + 1
    filled = np.diff(strands.starts) > 0
    before[strands.starts[:-1][filled]] += 1
    after[strands.starts[1:][filled] - 1] -= 1
    return _unit(points[after] - points[before])


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Return normalized vectors, (n, 3) float64; 0 stays 0."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    unit: np.ndarray = vectors / np.maximum(length, 1e-300)
    return unit
