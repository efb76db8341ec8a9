"""Large bent surfaces in parts that face one way each, which can be projected: xatlas takes long for them.

The directions are found by clustering of the normals (spherical k-means, started with the farthest normal);
polygons take the direction that most of their neighbours have, so that borders are short.
"""

from __future__ import annotations

import numpy as np

from ..array_ops import segment_sums
from .adjacency import Adjacency, components

#: Least polygons of a surface that is split, and of a part that is worth a chart.
_LARGE, _SMALL = 1500, 12

#: Most directions that one surface is split by.
_DIRECTIONS = 10

#: Cosine of the angle up to which polygons may be turned from their direction; beyond it more are needed.
_FAR = np.cos(np.radians(55))

#: Rounds of clustering, and of taking the neighbours' direction.
_ROUNDS, _SMOOTHING = 4, 6


def split_by_normal(
    normals: np.ndarray, adjacency: Adjacency, smooth: np.ndarray, part: np.ndarray, bent: np.ndarray
) -> np.ndarray:
    """Return the part of each polygon, (p,) int64, with those that are large and bent in pieces.

    normals  (p, 3), of polygons, as long as they are large
    smooth   (n,) bool, pairs of polygons without a crease between them
    part     (p,) int64; bent (c,) bool, parts that cannot be projected
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

    # Pieces too small for a chart join the neighbour that most of their edges are common with.
    same = facing[first] == facing[second]
    piece = components(len(part), first[same], second[same])
    facing = _without_crumbs(facing, piece, first, second)
    same = facing[first] == facing[second]
    others = smooth & ~np.isin(part[adjacency.first], large)
    return components(
        len(part), np.r_[first[same], adjacency.first[others]], np.r_[second[same], adjacency.second[others]]
    )


def _cluster(normals: np.ndarray) -> np.ndarray:
    """Return a direction's number for each normal, (n,) int64: as few directions as are near to all."""
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
    """Return for each polygon the direction that most of its neighbours and itself, twice, have."""
    votes = np.zeros((len(facing), facing.max(initial=0) + 1), np.int8)
    np.add.at(votes, (first, facing[second]), 2)
    np.add.at(votes, (second, facing[first]), 2)
    votes[np.arange(len(facing)), facing] += 3
    return votes.argmax(axis=1)


def _without_crumbs(
    facing: np.ndarray, piece: np.ndarray, first: np.ndarray, second: np.ndarray
) -> np.ndarray:
    """Return the directions with small pieces turned into what surrounds them."""
    small = np.bincount(piece)[piece] < _SMALL
    border = facing[first] != facing[second]
    inner = np.r_[first[border], second[border]]
    outer = np.r_[second[border], first[border]]
    inner, outer = inner[small[inner]], outer[small[inner]]
    votes = np.zeros((piece.max(initial=-1) + 1, facing.max(initial=0) + 1), np.int64)
    np.add.at(votes, (piece[inner], facing[outer]), 1)
    asked = votes.any(axis=1)[piece] & small
    return np.where(asked, votes.argmax(axis=1)[piece], facing)
