"""Detects open surfaces: connected triangles with unpaired edges, whose back faces may be visible."""

from __future__ import annotations

import operator
from collections.abc import Sequence

import numpy as np

from ..array_ops import (
    joined_rows,
    largest_in_rows,
    map_blocks,
    map_slabs,
    order_of_hashes,
    run_starts,
    taken,
)  # fmt: skip
from .memo import Memo
from .model import Mesh

#: Vertices are welded if they are nearer than this fraction of the scene's largest coordinate. This is the
#: float32 rounding of world positions of touching objects, such as the bodies that glTF splits by material.
_WELD = 2.0**-18

#: Shifts of two welding grids, as fractions of a cell, so that the cell borders of one grid are cell centres
#: of the other. The shifts are irrational, because modelled coordinates are round numbers and should not lie
#: on borders.
_SHIFTS = (0.3819660112501051, 0.8819660112501051)

#: Multipliers and shifts of the hash: the finalizer of SplitMix64 (Steele, Lea and Flood 2014).
_MIX = ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB))
_LAST_SHIFT = 31


class OpenSurfaces:
    """Finds the open surfaces of successive versions of a scene; unchanged meshes are not examined again."""

    def __init__(self) -> None:
        self._closed: dict[int, tuple[np.ndarray, bool]] = {}
        self._open: tuple[list[np.ndarray], np.ndarray] = [], np.zeros(0, bool)
        self._parts = Memo[np.ndarray]()

    def of(self, meshes: Sequence[Mesh]) -> np.ndarray:
        """Return `open_triangles` of meshes; a mesh that is closed by itself does not close others."""
        if len(meshes) == 1:
            return self._of_open(list(meshes))
        self._examine([mesh.positions for mesh in meshes])
        is_open = np.array([not self._closed[id(mesh.positions)][1] for mesh in meshes], bool)
        found = np.zeros(sum(len(mesh.positions) for mesh in meshes), bool)
        if is_open.any():
            others = [mesh for mesh, examined in zip(meshes, is_open, strict=True) if examined]
            lengths = [len(mesh.positions) for mesh in meshes]
            found[np.repeat(is_open, lengths)] = self._of_open(others)
        return found

    def of_parts(self, meshes: Sequence[Mesh], chosen: Sequence[np.ndarray]) -> np.ndarray:
        """Return `open_triangles` of parts of meshes.

        chosen:  (t,) bool for each mesh, the triangles of its part
        """
        parts = [(mesh, some) for mesh, some in zip(meshes, chosen, strict=True) if some.any()]
        if not parts:
            return np.zeros(0, bool)
        key = tuple((mesh.positions, some) for mesh, some in parts)
        return self._parts.get(key, lambda: open_triangles([mesh.subset(some) for mesh, some in parts]))

    def _examine(self, positions: Sequence[np.ndarray]) -> None:
        """Find out which meshes are closed by themselves; forget all other meshes."""
        known, self._closed = self._closed, {}
        unknown = list({id(each): each for each in positions if id(each) not in known}.values())
        closed = {id(each): (each, flag) for each, flag in zip(unknown, closed_meshes(unknown), strict=True)}
        self._closed = {id(each): known.get(id(each)) or closed[id(each)] for each in positions}

    def _of_open(self, meshes: list[Mesh]) -> np.ndarray:
        """Return `open_triangles` of the meshes that are not closed by themselves."""
        positions = [mesh.positions for mesh in meshes]
        before, found = self._open
        same = len(before) == len(positions) and all(map(operator.is_, before, positions))
        if not same:
            found = open_triangles(meshes)
            self._open = positions, found
        return found


def closed_meshes(positions: Sequence[np.ndarray]) -> list[bool]:
    """Return True for each mesh whose edges all have an even number of triangles in one welding grid.

    The exclusive or of the hashes of a mesh's edges is 0 then, and otherwise by a chance of 2^-64.

    positions:  (t, 3, 3) float32 of each mesh, m
    """
    counts = np.array([len(each) for each in positions])
    closed = counts == 0
    for shift in _SHIFTS:
        chosen = np.flatnonzero(~closed)
        if not len(chosen):
            break
        corners = joined_rows([positions[index] for index in chosen])
        starts = np.cumsum(counts[chosen]) - counts[chosen]
        largest = np.maximum.reduceat(_largest_coordinates(corners), starts)
        edges = _edge_keys(corners, np.repeat(_cell(largest), counts[chosen]), shift)
        closed[chosen] = np.bitwise_xor.reduceat(edges[:, 0] ^ edges[:, 1] ^ edges[:, 2], starts) == 0
    return list(closed)


def open_triangles(meshes: Sequence[Mesh]) -> np.ndarray:
    """Return a mask of the triangles of open surfaces, (t,) bool, for all meshes in order.

    Vertices are welded across meshes. A component of triangles connected by edges is closed if each of its
    edges has an even number of triangles.
    """
    positions = joined_rows([mesh.positions for mesh in meshes])
    count = len(positions)
    cells = np.full(count, _cell(_largest_coordinates(positions).max(initial=0)))
    left, some, joined = np.arange(3 * count), np.arange(count), []
    for shift in _SHIFTS:
        # The second grid tests the edges that the first leaves over; paired edges do not change parities.
        keys = _edge_keys(positions if len(some) == count else positions[some], cells[some], shift)
        keys = keys.ravel() if len(left) == 3 * count else keys[np.searchsorted(some, left // 3), left % 3]
        if not (has_length := keys != 0).all():
            left, keys = left[has_length], keys[has_length]
        # If the XOR of all keys is 0, each edge has an even number of triangles: the meshes are closed.
        # Keys of open edges cancel by chance with a probability of 2^-64; see `closed_meshes`.
        if not np.bitwise_xor.reduce(keys):
            return np.zeros(count, bool)
        odd, neighbours = _paired(keys)
        joined.append((neighbours if len(left) == 3 * count else left[neighbours]) // 3)
        left = left[odd]
        some = np.unique(left // 3)
    return _components_of(some, np.concatenate(joined, axis=1), count)


def _largest_coordinates(positions: np.ndarray) -> np.ndarray:
    """Return the largest absolute coordinate of each triangle, (t,) float32."""
    largest = np.empty(len(positions), np.float32)

    def find(rows: slice) -> None:
        largest[rows] = largest_in_rows(np.abs(positions[rows]).reshape(-1, 9))

    map_slabs(len(positions), 72, find)
    return largest


def _cell(largest: np.ndarray) -> np.ndarray:
    """Return the width of the welding grid for a largest coordinate, m."""
    return np.maximum(_WELD * np.asarray(largest, np.float64), 1e-30)


def _edge_keys(positions: np.ndarray, cells: np.ndarray, shift: float) -> np.ndarray:
    """Return a key of each edge of triangles, (t, 3) uint64: equal for edges with the same welded ends.

    Edges without length have the key 0.

    positions:  (t, 3, 3) float32, m
    cells:      (t,) width of the welding grid, m
    shift:      shift of the grid, cells
    """
    edges = np.empty(positions.shape[:2], np.uint64)

    def find(block: slice) -> None:
        # Coordinates first: short rows are slow in NumPy.
        scaled = np.ascontiguousarray(positions[block].transpose(2, 1, 0)) / cells[block]
        scaled += shift
        x, y, z = np.floor(scaled, out=scaled).astype(np.int64)
        corners = _mixed((x << 42) ^ (y << 21) ^ z)
        following = corners[[1, 2, 0]]
        keys = _mixed(corners + following)
        keys[corners == following] = 0
        edges[block] = keys.T

    map_blocks(len(positions), 400, find)
    return edges


def _mixed(keys: np.ndarray) -> np.ndarray:
    """Return a 64-bit hash of each integer, uint64; see `_MIX`."""
    mixed = keys.astype(np.uint64)
    for shift, factor in _MIX:
        mixed ^= mixed >> np.uint64(shift)
        mixed *= np.uint64(factor)
    mixed ^= mixed >> np.uint64(_LAST_SHIFT)
    return mixed


def _paired(keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find equal keys, (k,) uint64.

    Returns the indices of keys that occur an odd number of times, ascending, (k,) int64, and the indices of
    pairs of equal keys that connect all equal ones, (2, p) int64.
    """
    order, ordered = order_of_hashes(keys)
    lengths = np.diff(run_starts(ordered), append=len(keys))
    odd = np.sort(order[np.repeat(lengths % 2 == 1, lengths)])
    same = np.flatnonzero(ordered[1:] == ordered[:-1])
    return odd, np.stack([order[same], order[same + 1]])


def _components_of(chosen: np.ndarray, neighbours: np.ndarray, count: int) -> np.ndarray:
    """Return the triangles that edges connect to chosen ones, (count,) bool.

    Label propagation: the smallest label spreads over shared edges, with pointer jumping (Shiloach and
    Vishkin 1982).

    chosen:      (m,) int64, triangles
    neighbours:  (2, p) int64, pairs of triangles with a common edge
    """
    label, (one, other) = np.arange(count), neighbours
    while len(one):
        np.minimum.at(label, np.maximum(one, other), np.minimum(one, other))
        while not np.array_equal(further := taken(label, label), label):
            label = further
        one, other = taken(label, one), taken(label, other)
        differ = one != other
        one, other = one[differ], other[differ]
    is_chosen = np.zeros(count, bool)
    is_chosen[label[chosen]] = True
    result: np.ndarray = is_chosen[label]
    return result
