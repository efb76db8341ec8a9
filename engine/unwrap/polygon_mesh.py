"""Polygon mesh for unwrapping, and its charts."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np


@dataclass(frozen=True)
class PolygonMesh:
    """Mesh to be unwrapped.

    positions:  (v, 3) float64, world space, metres
    corners:    (l,) int32, vertex of each loop; a polygon's loops are consecutive
    starts:     (p + 1,) int32, first loop of each polygon, then l
    triangles:  (t, 3) int32, loops of each triangle
    polygon:    (t,) int32, polygon of each triangle
    parted:     (k,) int64, loops whose edges separate charts
    degenerate (d,) int64, triangles without area in the precision of their coordinates
    """

    name: str
    positions: np.ndarray
    corners: np.ndarray
    starts: np.ndarray
    triangles: np.ndarray
    polygon: np.ndarray
    parted: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    degenerate: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))

    @cached_property
    def after(self) -> np.ndarray:
        """Next loop along each loop's polygon, (l,) int64."""
        after = np.arange(1, len(self.corners) + 1)
        filled = np.diff(self.starts) > 0
        after[self.starts[1:][filled] - 1] = self.starts[:-1][filled]
        return after

    @cached_property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corner of the box around the vertices, (3,) float64 each, metres."""
        return self.positions.min(axis=0), self.positions.max(axis=0)

    @property
    def area(self) -> float:
        """Surface area, m^2."""
        return float(areas(self.positions[self.corners[self.triangles]]).sum())


@dataclass(frozen=True)
class MeshCharts:
    """Charts of a mesh, flattened but not packed.

    uvs:    (l, 2) float64, metres, UV of each loop
    chart:  (t,) int64, chart of each triangle; -1 for polygons without area, which need no texels
    """

    uvs: np.ndarray
    chart: np.ndarray


def areas(corners: np.ndarray) -> np.ndarray:
    """Return the areas of triangles in space, (t, 3, 3) -> (t,)."""
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2


def signed_areas(corners: np.ndarray) -> np.ndarray:
    """Return the areas of triangles in the plane, (t, 3, 2) -> (t,), positive counter-clockwise."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
