"""Normal clustering: splits large curved surfaces into parts that can be projected, since xatlas is slow.

The directions come from spherical k-means of the normals, started with the farthest normal. Polygons then
adopt the majority direction of their neighbours, which shortens borders.
"""

from __future__ import annotations

import numpy as np

from ..array_ops import segment_sums
from .adjacency import Adjacency, components

#: Minimum number of polygons of a surface to split, and of a part to become a chart.
_LARGE, _SMALL = 1500, 12

#: Maximum number of directions per surface.
_DIRECTIONS = 10

#: Cosine of the maximum angle between a polygon and its direction; beyond it a direction is added.
_FAR = np.cos(np.radians(55))

#: Iterations of k-means, and of the majority filter.
_ROUNDS, _SMOOTHING = 4, 6


def split_by_normal(
    normals: np.ndarray, adjacency: Adjacency, smooth: np.ndarray, part: np.ndarray, bent: np.ndarray
) -> np.ndarray:
    """Return the part of each polygon, (p,) int64, with large curved parts split.

    normals:  (p, 3), area-weighted normals of polygons
    smooth:   (n,) bool, pairs of polygons without a crease between them
    part:     (p,) int64, smooth part of each polygon
    bent:     (c,) bool, parts that cannot be projected
    """
    size = np.bincount(part)
    large = np.flatnonzero(bent & (size >= _LARGE))
    if not len(large):
        return part
    facing = np.zeros(len(part), np.int64)
    for number in large.tolist():
        members = np.flatnonzero(part == number)
        facing[members] = _cluster(normals[members])
    first, second = adjacency.first[smooth], adjacency.second[smooth]
    inside = np.isin(part[first], large)
    first, second = first[inside], second[inside]
    for _ in range(_SMOOTHING):
        facing = _with_neighbours(facing, first, second)

    # Merge pieces that are too small for a chart with the neighbour that shares the longest border.
    same = facing[first] == facing[second]
    piece = components(len(part), first[same], second[same])
    facing = _without_crumbs(facing, piece, first, second)
    same = facing[first] == facing[second]
    others = smooth & ~np.isin(part[adjacency.first], large)
    return components(
        len(part), np.r_[first[same], adjacency.first[others]], np.r_[second[same], adjacency.second[others]]
    )


def _cluster(normals: np.ndarray) -> np.ndarray:
    """Cluster normals, (n, 3), by direction; return the cluster of each, (n,) int64."""
    weight = np.linalg.norm(normals, axis=1)
    unit = normals / np.maximum(weight, 1e-300)[:, None]
    centres = _unit(normals.sum(axis=0, keepdims=True))
    while True:
        for _ in range(_ROUNDS):
            nearest = (unit @ centres.T).argmax(axis=1)
            centres = _unit(segment_sums(normals, nearest, len(centres)))
        cosine = (unit @ centres.T).max(axis=1)
        far = (cosine < _FAR) & (weight > 0)
        if len(centres) >= _DIRECTIONS or weight[far].sum() <= 0.01 * weight.sum():
            return (unit @ centres.T).argmax(axis=1)
        centres = np.r_[centres, unit[[np.where(weight > 0, cosine, 2).argmin()]]]


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)


def _with_neighbours(facing: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the majority direction of each polygon's neighbours.

    The polygon's own direction counts as 1.5 neighbours.
    """
    votes = np.zeros((len(facing), facing.max(initial=0) + 1), np.int8)
    np.add.at(votes, (first, facing[second]), 2)
    np.add.at(votes, (second, facing[first]), 2)
    votes[np.arange(len(facing)), facing] += 3
    return votes.argmax(axis=1)


def _without_crumbs(
    facing: np.ndarray, piece: np.ndarray, first: np.ndarray, second: np.ndarray
) -> np.ndarray:
    """Merge small pieces of equal direction into the piece around them; return the directions."""
    small = np.bincount(piece)[piece] < _SMALL
    border = facing[first] != facing[second]
    inner = np.r_[first[border], second[border]]
    outer = np.r_[second[border], first[border]]
    inner, outer = inner[small[inner]], outer[small[inner]]
    votes = np.zeros((piece.max(initial=-1) + 1, facing.max(initial=0) + 1), np.int64)
    np.add.at(votes, (piece[inner], facing[outer]), 1)
    asked = votes.any(axis=1)[piece] & small
    return np.where(asked, votes.argmax(axis=1)[piece], facing)
