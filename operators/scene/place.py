"""A place in an atlas, and what decides how large it is to be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .scene_objects import Reading

#: Smallest width and height of the box around charts, in UVs, and smallest part of it that they fill.
_SMALLEST_BOX, _LEAST_FILLED = 1e-4, 0.05


@dataclass(frozen=True)
class Place:
    """A place in an atlas: lightmap uv = uv of the mesh * scale + offset."""

    atlas: str
    scale: float = 1.0
    offset: tuple[float, float] = (0.0, 0.0)

    def apply(self, uvs: np.ndarray) -> np.ndarray:
        """Return UVs of the mesh, (..., 2) float32, as lightmap UVs."""
        if (self.scale, self.offset) == (1.0, (0.0, 0.0)):
            return uvs
        return (uvs.astype(np.float64) * self.scale + np.array(self.offset)).astype(np.float32)


def takes_textures(reading: Reading, place: Place) -> bool:
    """Return whether textures that are made over a reading's lightmap UVs lie where its charts are put.

    Of several that show one mesh, with tiles in an atlas of their own, the mesh itself has the textures.
    """
    return place.atlas == reading.atlas


@dataclass(frozen=True)
class ChartBox:
    """The box around charts.

    low, high  (2,) float64, UVs
    density    UV lengths per metre
    """

    low: np.ndarray
    high: np.ndarray
    density: float

    @property
    def size(self) -> np.ndarray:
        """Width and height, (2,) float64, metres."""
        return (self.high - self.low) / self.density

    def place(self, atlas: str, corner: tuple[int, int], scale: float, resolution: int) -> Place:
        """Return the place whose lower left corner is a texel, at a scale in texels per metre."""
        factor = scale / self.density / resolution
        x, y = np.array(corner) / resolution - self.low * factor
        return Place(atlas, float(factor), (float(x), float(y)))


def chart_box(reading: Reading) -> ChartBox:
    """Return the box around a reading's charts, and how dense they are for its scale in lightmaps."""
    uvs = reading.shape.corners.uvs.astype(np.float64)
    low = uvs.min(axis=(0, 1))
    high = np.maximum(uvs.max(axis=(0, 1)), low + _SMALLEST_BOX)
    flat = max(_flat_area(uvs), _LEAST_FILLED * float(np.prod(high - low)))
    area = _world_area(reading) * reading.scale**2
    return ChartBox(low, high, float(np.sqrt(flat / area)) if area > 0 else 1.0)


def _flat_area(uvs: np.ndarray) -> float:
    """Return the area of triangles in UV space, (t, 3, 2)."""
    (u1, v1), (u2, v2) = (np.moveaxis(uvs[:, k] - uvs[:, 0], 1, 0) for k in (1, 2))
    return float(np.abs(u1 * v2 - u2 * v1).sum()) / 2


def _world_area(reading: Reading) -> float:
    """Return the surface of a reading, m^2."""
    positions = reading.shape.corners.positions @ reading.matrix[:3, :3].T
    sides = np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0])
    return float(np.linalg.norm(sides, axis=1).sum()) / 2
