"""Surfaces of quad grids, and meshes of several, each with its own chart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.rooms import packed
from engine import Mesh
from tests.analytic.scenes import Chart


@dataclass(frozen=True)
class Surface:
    """A grid of quads with a chart of its own, seen from the side of columns x rows.

    points:  (rows + 1, columns + 1, 3) float64, m
    """

    points: np.ndarray
    material: int

    @property
    def size(self) -> tuple[float, float]:
        """The largest length along u and v, m."""
        along = [np.linalg.norm(np.diff(self.points, axis=axis), axis=2).sum(axis=axis) for axis in (1, 0)]
        return float(along[0].max()), float(along[1].max())


def quad(corners: np.ndarray, material: int) -> Surface:
    """Return a surface of one quad, (4, 3), counter-clockwise from its front."""
    return Surface(np.stack([corners[:2], corners[[3, 2]]]), material)


def turned(radius: np.ndarray, height: np.ndarray, foot: np.ndarray, columns: int, material: int) -> Surface:
    """Return a profile that is turned about a vertical axis.

    radius:  (rows + 1, 1) or (rows + 1, columns + 1), m
    height:  (rows + 1,), m, ascending
    """
    turn = 2 * np.pi * np.linspace(0, 1, columns + 1)
    upward = np.broadcast_to(height[:, None], (len(height), columns + 1))
    points = [radius * np.cos(turn), radius * np.sin(turn), upward]
    return Surface(np.stack(points, axis=-1) + foot, material)


def charted_surfaces(surfaces: Sequence[Surface], resolution: int, name: str) -> Mesh:
    """Return a mesh, smooth over each surface, whose charts fill a lightmap."""
    charts = packed([surface.size for surface in surfaces], resolution, (0, resolution))
    parts = [_triangles(surface, chart, resolution) for surface, chart in zip(surfaces, charts, strict=True)]
    counts = [len(part[0]) for part in parts]
    positions, normals, uvs = (
        np.concatenate(arrays).astype(np.float32) for arrays in zip(*parts, strict=True)
    )
    face, subface = np.divmod(np.arange(len(positions), dtype=np.int32), 2)
    materials = np.repeat(np.array([surface.material for surface in surfaces], np.int32), counts)
    return Mesh(name, positions, normals, uvs, face, subface, materials)


def _triangles(surface: Surface, chart: Chart, resolution: int) -> tuple[np.ndarray, ...]:
    """Return positions, normals and UVs, (t, 3, 3 or 2) float64, of a surface's triangles, two a quad."""
    points, (left, low, across, up) = surface.points, chart
    rows, columns = points.shape[0] - 1, points.shape[1] - 1
    normals = np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    u, v = np.meshgrid(np.linspace(left, left + across, columns + 1), np.linspace(low, low + up, rows + 1))
    corner = np.array([[[0, 0], [0, 1], [1, 1]], [[0, 0], [1, 1], [1, 0]]])
    row, column = np.divmod(np.arange(rows * columns), columns)
    i, j = row[:, None, None] + corner[..., 0], column[:, None, None] + corner[..., 1]
    grids = (points, normals, np.stack([u, v], axis=-1) / resolution)
    return tuple(grid[i, j].reshape(-1, 3, grid.shape[-1]) for grid in grids)
