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

    bounds:      (2, 3) float64, corner and size of the box around the points, m
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

    Cells between probes are split into six tetrahedra each (Kuhn 1960); an axis with one probe gets two.

    coefficients:  (n, 9, 3) float32, radiance SH L2 in Blender's axes, x fastest
    matrix:        (4, 4) float64, from the unit cube [-1, 1]^3 to Blender's world space, m
    """
    x, y, z = resolution
    grid = coefficients.reshape(z, y, x, 9, 3)
    for axis, count in enumerate((z, y, x)):
        grid = np.repeat(grid, 2, axis=axis) if count == 1 else grid
    size = np.array(grid.shape[2::-1])
    axes = Y_UP @ matrix[:3, :3]
    steps = np.where(np.array(resolution) == 1, 1, 2 / np.maximum(np.array(resolution), 1)) * axes
    origin = Y_UP @ matrix[:3, 3] - steps @ ((size - 1) / 2)
    indices = np.stack(np.meshgrid(*map(np.arange, size[::-1]), indexing="ij")[::-1], axis=-1).reshape(-1, 3)
    points = origin + indices @ steps.T
    tree = _Tree(size, origin, np.linalg.inv(steps))
    tree.split((0, 0, 0), tuple(size - 1))
    turned = with_axes(grid.reshape(-1, 9, 3), Y_UP) / np.float32(np.pi)
    low, high = points.min(axis=0), points.max(axis=0)
    return GodotProbes(
        np.stack([low, high - low]),
        points.astype(np.float32),
        turned.reshape(-1, 3),
        np.array(tree.tetrahedra, np.int32),
        tree.records(),
    )


#: A cell or a corner of the grid: its index along each axis.
_Index = tuple[int, ...]


class _Tree:
    """BSP tree over the cells of a grid.

    size:     number of points along each axis
    origin:   first point, m
    to_grid:  (3, 3) matrix from world vectors to steps of the grid
    """

    def __init__(self, size: np.ndarray, origin: np.ndarray, to_grid: np.ndarray) -> None:
        self._size, self._origin, self._to_grid = size, origin, to_grid
        self._planes: list[np.ndarray] = []
        self._children: list[list[int]] = []
        self.tetrahedra: list[list[int]] = []

    def records(self) -> np.ndarray:
        """Return the nodes, (b, 6) int32, see `GodotProbes`."""
        planes = np.array(self._planes, np.float32).view(np.int32)
        return np.concatenate([planes, np.array(self._children, np.int32)], axis=1)

    def split(self, low: _Index, high: _Index) -> int:
        """Add nodes for the cells low <= c < high; return the first."""
        widths = np.subtract(high, low)
        axis = int(widths.argmax())
        if widths[axis] == 1:
            return self._cell(low)
        middle = low[axis] + int(widths[axis]) // 2
        node = self._node(np.eye(3)[axis], middle)
        below, above = list(high), list(low)
        below[axis] = above[axis] = middle
        under = self.split(low, tuple(below))
        self._children[node] = [self.split(tuple(above), high), under]
        return node

    def _node(self, direction: np.ndarray, distance: float) -> int:
        """Add a node that splits where direction . grid = distance; return its index."""
        normal = direction @ self._to_grid
        length = np.linalg.norm(normal)
        self._planes.append(np.append(normal, distance + normal @ self._origin) / length)
        self._children.append([0, 0])
        return len(self._planes) - 1

    def _cell(self, cell: _Index) -> int:
        """Add the nodes of a cell, which compare its coordinates in pairs; return the first."""
        first = self._compare(cell, 0, 1)
        nodes = []
        for larger, smaller in ((0, 1), (1, 0)):
            # The third coordinate is compared with the smaller one, then with the larger one.
            node, last = self._compare(cell, smaller, 2), self._compare(cell, larger, 2)
            self._children[last] = [
                self._tetrahedron(cell, (larger, 2, smaller)),
                self._tetrahedron(cell, (2, larger, smaller)),
            ]
            self._children[node] = [self._tetrahedron(cell, (larger, smaller, 2)), last]
            nodes.append(node)
        self._children[first] = nodes
        return first

    def _compare(self, cell: _Index, one: int, other: int) -> int:
        """Add a node that is over where coordinate `one` in the cell exceeds `other`; return its index."""
        axes = np.eye(3)
        return self._node(axes[one] - axes[other], cell[one] - cell[other])

    def _tetrahedron(self, cell: _Index, order: _Index) -> int:
        """Add the tetrahedron of points whose coordinates descend in an order; return its code."""
        corner = list(cell)
        points = [self._number(corner)]
        for axis in order:
            corner[axis] += 1
            points.append(self._number(corner))
        self.tetrahedra.append(points)
        return -len(self.tetrahedra)

    def _number(self, corner: list[int]) -> int:
        """Return the number of a point."""
        x, y, z = corner
        return int((z * self._size[1] + y) * self._size[0] + x)
