"""Probes as Godot's LightmapGIData stores them: points, tetrahedra, and a BSP tree that finds one of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .spherical_harmonics import with_axes

#: Axes with y up of Godot, three.js and Bevy, as rows in Blender's axes.
Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


@dataclass(frozen=True)
class GodotProbes:
    """Entries of `LightmapGIData.probe_data`, in Godot's axes (y up).

    bounds:      (2, 3) float64, corner and size of the box around the volume, m
    points:      (n, 3) float32, m
    sh:          (9 n, 3) float32, radiance SH / pi: nine colors for each point
    tetrahedra:  (t, 4) int32, points of each tetrahedron
    bsp:         (b, 6) int32, nodes: normal and distance of a plane as bits of float32, the children over and
                 under it: a node, or -(t + 1) for tetrahedron t
    """

    bounds: np.ndarray
    points: np.ndarray
    sh: np.ndarray
    tetrahedra: np.ndarray
    bsp: np.ndarray


def godot_probes(
    coefficients: np.ndarray, resolution: tuple[int, int, int], matrix: np.ndarray
) -> GodotProbes:
    """Return the probes of a volume for Godot 4.

    Cells between probes are split into six tetrahedra each (Kuhn 1960). A copy of the outermost probes a cell
    farther out keeps the light constant up to the border of the volume: Godot extrapolates, and objects
    outside of the bounds keep the light of their last place.

    coefficients:  (n, 9, 3) float32, radiance SH L2 in Blender's axes, x fastest
    matrix:        (4, 4) float64, from the unit cube [-1, 1]^3 to Blender's world space, m
    """
    x, y, z = resolution
    grid = np.pad(coefficients.reshape(z, y, x, 9, 3), [(1, 1)] * 3 + [(0, 0)] * 2, mode="edge")
    size = np.array(grid.shape[2::-1])
    axes, centre = Y_UP @ matrix[:3, :3], Y_UP @ matrix[:3, 3]
    steps = 2 / np.array(resolution) * axes
    origin = centre - steps @ ((size - 1) / 2)
    indices = np.stack(np.meshgrid(*map(np.arange, size[::-1]), indexing="ij")[::-1], axis=-1).reshape(-1, 3)
    points = origin + indices @ steps.T
    records, tetrahedra = _tree(size, origin, np.linalg.inv(steps))
    turned = with_axes(grid.reshape(-1, 9, 3), Y_UP) / np.float32(np.pi)
    extent = np.abs(axes).sum(axis=1)
    return GodotProbes(
        np.stack([centre - extent, 2 * extent]),
        points.astype(np.float32),
        turned.reshape(-1, 3),
        tetrahedra,
        records,
    )


#: Nodes and tetrahedra of a cell.
_NODES, _TETRAHEDRA = 5, 6

#: Pair of coordinates that each node of a cell compares; points whose first one is larger lie over the node.
_COMPARED = ((0, 1), (1, 2), (0, 2), (0, 2), (1, 2))

#: Children over and under each node of a cell: a node, or -(t + 1) for tetrahedron t of the cell.
_CHILDREN = ((1, 3), (-3, 2), (-1, -2), (-6, 4), (-4, -5))

#: Axes of each of the six tetrahedra of a cell, sorted by descending coordinate: (0, 2, 1) is the tetrahedron
#: with x >= z >= y.
_ORDERS = ((0, 2, 1), (2, 0, 1), (0, 1, 2), (1, 2, 0), (2, 1, 0), (1, 0, 2))


def _tree(size: np.ndarray, origin: np.ndarray, to_grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the BSP tree over the cells of a grid, and the tetrahedra; see `GodotProbes`.

    size:     number of points along each axis
    origin:   first point, m
    to_grid:  (3, 3) matrix from world vectors to steps of the grid
    """
    directions, distances, children, cells = _splits(size - 1)
    inner, count = len(directions), len(cells)
    directions = np.concatenate([directions, np.tile(_differences(np.eye(3)), (count, 1))])
    distances = np.concatenate([distances, _differences(cells.T).T.ravel()])
    of_cells = np.tile(np.array(_CHILDREN), (count, 1, 1))
    index = np.arange(count)[:, None, None]
    of_cells += np.where(of_cells < 0, -_TETRAHEDRA * index, inner + _NODES * index)
    children = np.concatenate([children, of_cells.reshape(-1, 2)])
    normals = directions @ to_grid
    planes = np.column_stack([normals, distances + normals @ origin])
    planes /= np.linalg.norm(normals, axis=1, keepdims=True)
    records = np.column_stack([planes.astype(np.float32).view(np.int32), children.astype(np.int32)])
    return records, _tetrahedra(cells, size)


def _differences(rows: np.ndarray) -> np.ndarray:
    """Return the difference of the rows that each node of a cell compares, (5, ...), from (3, ...)."""
    return np.stack([rows[one] - rows[other] for one, other in _COMPARED])


def _splits(size: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the nodes that halve boxes of cells along their widest axis, until each is one cell.

    Returns directions, (s, 3), distances along them, (s,), children, (s, 2), and the cells, (c, 3); distances
    and cells in steps of the grid. Nodes of the cells follow the nodes of the boxes.

    size:  number of cells along each axis
    """
    last = int(size.prod()) - 1
    directions, distances = np.zeros((last, 3)), np.zeros(last)
    children, cells = np.zeros((last, 2), np.int64), np.zeros((last + 1, 3), np.int64)
    low, high = np.zeros((1, 3), np.int64), size[None].astype(np.int64)
    first = made = 0
    places = np.zeros(0, np.int64)
    while len(low):
        axis = (high - low).argmax(axis=1)
        rows = np.arange(len(low))
        width = (high - low)[rows, axis]
        is_cell = width == 1
        splits, count = np.flatnonzero(~is_cell), int(is_cell.sum())
        nodes = np.zeros(len(low), np.int64)
        nodes[splits] = first + np.arange(len(splits))
        nodes[is_cell] = last + _NODES * (made + np.arange(count))
        children.reshape(-1)[places] = nodes[: len(places)]
        cells[made : made + count] = low[is_cell]
        made += count
        axis, middle = axis[splits], (low[rows, axis] + width // 2)[splits]
        own = nodes[splits]
        directions[own, axis], distances[own] = 1, middle
        above, below = low[splits], high[splits]
        above[np.arange(len(splits)), axis] = below[np.arange(len(splits)), axis] = middle
        # The half over a node and the half under it follow each other.
        low, high = (
            np.stack(pair, axis=1).reshape(-1, 3) for pair in ((above, low[splits]), (high[splits], below))
        )
        places = np.stack([2 * own, 2 * own + 1], axis=1).ravel()
        first += len(splits)
    return directions, distances, children, cells


def _tetrahedra(cells: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return the points of the tetrahedra of cells, (6 c, 4) int32.

    cells:  (c, 3) int64
    size:   number of points along each axis
    """
    strides = np.array([1, size[0], size[0] * size[1]])
    steps = np.stack([np.append(0, np.cumsum(strides[list(order)])) for order in _ORDERS])
    points: np.ndarray = (cells @ strides)[:, None, None] + steps
    return points.reshape(-1, 4).astype(np.int32)
