"""A place in an atlas, and what decides how large it is to be."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

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


@dataclass(frozen=True, eq=False)
class Charted:
    """The charts of an object, and what they show.

    uvs        (t, 3, 2) float32
    positions  (t, 3, 3) float32, object space
    matrix     (4, 4) float64, object space to world space
    scale      its scale in lightmaps
    """

    uvs: np.ndarray
    positions: np.ndarray
    matrix: np.ndarray
    scale: float

    @classmethod
    def of(cls, reading: Reading) -> Charted:
        """Return the charts of a reading that has lightmap UVs."""
        corners = reading.shape.corners
        return cls(corners.uvs, corners.positions, reading.matrix, reading.scale)

    @cached_property
    def flat_area(self) -> float:
        """The area of the charts, in UV space."""
        (u1, v1), (u2, v2) = ((self.uvs[:, k] - self.uvs[:, 0]).T for k in (1, 2))
        return float(np.abs(u1 * v2 - u2 * v1).sum(dtype=np.float64)) / 2

    @cached_property
    def surface(self) -> float:
        """The surface in the world, m^2."""
        turn = self.matrix[:3, :3].T
        first, second = ((self.positions[:, k] - self.positions[:, 0]) @ turn for k in (1, 2))
        return float(np.linalg.norm(np.cross(first, second), axis=1).sum()) / 2


def chart_box(charted: Charted) -> ChartBox:
    """Return the box around an object's charts, and how dense they are for its scale in lightmaps."""
    columns = [charted.uvs[..., axis] for axis in range(2)]
    low = np.array([column.min() for column in columns], np.float64)
    high = np.maximum([column.max() for column in columns], low + _SMALLEST_BOX)
    flat = max(charted.flat_area, _LEAST_FILLED * float(np.prod(high - low)))
    area = charted.surface * charted.scale**2
    return ChartBox(low, high, float(np.sqrt(flat / area)) if area > 0 else 1.0)
