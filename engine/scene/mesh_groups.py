"""Groups of small meshes, so that scenes with many meshes are processed by few NumPy calls."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..array_ops import joined_rows
from .model import Mesh

#: Number of triangles from which on a mesh is a group of its own (chosen): its arrays are then not copied.
_LARGE = 1 << 12


def mesh_groups(meshes: Sequence[Mesh]) -> Iterator[Sequence[Mesh]]:
    """Divide meshes into groups of neighbours: a large mesh alone, or small ones of `_LARGE` triangles."""
    first, count = 0, 0
    for index, mesh in enumerate(meshes):
        size = len(mesh.positions)
        if count and count + size > _LARGE:
            yield meshes[first:index]
            first, count = index, 0
        count += size
    if first < len(meshes):
        yield meshes[first:]


def joined(meshes: Sequence[Mesh], name: str) -> np.ndarray:
    """Concatenate one array, such as "positions", of all meshes; that of a single mesh is not copied."""
    return joined_rows([getattr(mesh, name) for mesh in meshes])


def mesh_boxes(meshes: Sequence[Mesh]) -> np.ndarray:
    """Return lower and upper corner of the box around each mesh with triangles, (2, n, 3) float64, m."""
    parts: list[np.ndarray] = [np.empty((2, 0, 3))]
    for group in mesh_groups(meshes):
        counts = [3 * len(mesh.positions) for mesh in group]
        starts = np.cumsum([0, *counts[:-1]])
        corners = joined(group, "positions").reshape(-1, 3).T
        ends = [[end.reduceat(axis, starts) for axis in corners] for end in (np.minimum, np.maximum)]
        parts.append(np.array(ends, np.float64).transpose(0, 2, 1))
    return np.concatenate(parts, axis=1)
