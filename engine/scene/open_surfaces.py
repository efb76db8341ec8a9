"""Detects open surfaces: connected triangles with unpaired edges, whose back faces may be visible."""

from __future__ import annotations

import operator
from collections.abc import Sequence

import numpy as np

from ..array_ops import joined_rows, map_blocks, order_of_hashes, range_members, run_starts, taken
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

#: Runs of connected triangles are joined while at least one in this number of nodes follows another (chosen).
_FEWEST = 8


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
    chosen, corners = np.zeros(0, int), np.zeros((0, 3, 3), np.float32)
    for shift in _SHIFTS:
        before, chosen = chosen, np.flatnonzero(~closed)
        if not len(chosen):
            break
        if len(chosen) != len(before):
            corners = joined_rows([positions[index] for index in chosen])
        starts = np.cumsum(counts[chosen]) - counts[chosen]
        cells = np.repeat(_cell(_largest_coordinates(corners, starts)), counts[chosen])
        edges = _edge_keys(corners, cells, shift).ravel()
        closed[chosen] = np.bitwise_xor.reduceat(edges, 3 * starts) == 0
    return list(closed)


def open_triangles(meshes: Sequence[Mesh]) -> np.ndarray:
    """Return a mask of the triangles of open surfaces, (t,) bool, for all meshes in order.

    Vertices are welded across meshes. A component of triangles connected by edges is closed if each of its
    edges has an even number of triangles.
    """
    positions = joined_rows([mesh.positions for mesh in meshes])
    count = len(positions)
    if not count:
        return np.zeros(0, bool)
    cells = _cell(_largest_coordinates(positions, np.zeros(1, int)))
    keys, left = _edge_keys(positions, cells, _SHIFTS[0]).ravel(), np.zeros(0, int)
    joined: list[np.ndarray] = []
    for shift in _SHIFTS:
        # The second grid tests the edges that the first leaves over; paired edges do not change parities.
        if joined:
            some = _distinct(left // 3)
            keys = _edge_keys(positions[some], cells, shift)[np.searchsorted(some, left // 3), left % 3]
        has_length = keys != 0
        is_whole = not joined and bool(has_length.all())
        if not is_whole:
            left = left[has_length] if joined else np.flatnonzero(has_length)
            keys = keys[has_length]
        # If the XOR of all keys is 0, each edge has an even number of triangles: the meshes are closed.
        # Keys of open edges cancel by chance with a probability of 2^-64; see `closed_meshes`.
        if not np.bitwise_xor.reduce(keys):
            return np.zeros(count, bool)
        odd, neighbours = _paired(keys)
        joined.append((neighbours if is_whole else left[neighbours]) // 3)
        left = odd if is_whole else left[odd]
    return _components_of(_distinct(left // 3), np.concatenate(joined, axis=1), count)


def _distinct(ordered: np.ndarray) -> np.ndarray:
    """Return the distinct values of ascending ones, (n,) -> (k,)."""
    return ordered[run_starts(ordered)]


def _largest_coordinates(positions: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Return the largest absolute coordinate of each run of triangles, (m,) float32.

    positions:  (t, 3, 3) float32
    starts:     (m,) int64, first triangle of each run
    """
    values, firsts = positions.reshape(-1), 9 * starts
    return np.maximum(np.maximum.reduceat(values, firsts), -np.minimum.reduceat(values, firsts))


def _cell(largest: np.ndarray) -> np.ndarray:
    """Return the width of the welding grid for a largest coordinate, m."""
    return np.maximum(_WELD * np.asarray(largest, np.float64), 1e-30)


def _edge_keys(positions: np.ndarray, cells: np.ndarray, shift: float) -> np.ndarray:
    """Return a key of each edge of triangles, (t, 3) uint64: equal for edges with the same welded ends.

    Edges without length have the key 0.

    positions:  (t, 3, 3) float32, m
    cells:      (t,) or (1,) float64, width of the welding grid, m
    shift:      shift of the grid, cells
    """
    edges = np.empty(positions.shape[:2], np.uint64)

    def find(block: slice) -> None:
        # Coordinates first: short rows are slow in NumPy.
        corners = np.ascontiguousarray(positions[block].transpose(2, 1, 0))
        scaled = corners / (cells[block] if len(cells) > 1 else cells)
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
    starts = run_starts(ordered)
    lengths = np.diff(starts, append=len(keys))
    is_odd = lengths % 2 == 1
    odd = np.sort(order[range_members(starts[is_odd], lengths[is_odd])])
    same = np.flatnonzero(ordered[1:] == ordered[:-1])
    return odd, np.stack([taken(order, same), taken(order, same + 1)])


def _components_of(chosen: np.ndarray, neighbours: np.ndarray, count: int) -> np.ndarray:
    """Return the triangles that edges connect to chosen ones, (count,) bool.

    chosen:      (m,) int64, triangles
    neighbours:  (2, p) int64, pairs of triangles with a common edge
    """
    node, label = _labels(neighbours[0], neighbours[1], count)
    is_chosen = np.zeros(count, bool)
    is_chosen[label[node[chosen]]] = True
    return taken(taken(is_chosen, label), node)


def _labels(one: np.ndarray, other: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the node of each triangle, (count,) int64, and the label of each node's component, (k,) int64.

    Runs of successive connected triangles become nodes first, because most meshes store neighbours one after
    another. Then labels spread over edges, with pointer jumping (Shiloach and Vishkin 1982).

    one, other: (p,) int64, pairs of connected triangles
    """
    node = np.arange(count)
    while len(one):
        follows = np.zeros(count, bool)
        follows[np.maximum(one, other)[np.abs(one - other) == 1]] = True
        if np.count_nonzero(follows) <= count // _FEWEST:
            break
        number = np.cumsum(~follows) - 1
        node, count = taken(number, node), int(number[-1]) + 1
        one, other = _renamed(number, one, other)
    label = np.arange(count)
    while len(one):
        np.minimum.at(label, np.maximum(one, other), np.minimum(one, other))
        while not np.array_equal(further := taken(label, label), label):
            label = further
        one, other = _renamed(label, one, other)
    return node, label


def _renamed(number: np.ndarray, one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of nodes with new numbers, without pairs of equal ones."""
    one, other = taken(number, one), taken(number, other)
    differ = one != other
    return one[differ], other[differ]
