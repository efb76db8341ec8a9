"""UV transforms: places of charts in an atlas; and texel densities of charts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .scene_objects import ReadObject
from .slice_timer import Slices, row_slices

#: Minimum width and height of the box around charts in UV units, and minimum fraction of the box that charts
#: cover.
_SMALLEST_BOX, _LEAST_FILLED = 1e-4, 0.05


@dataclass(frozen=True)
class UvTransform:
    """Place of charts in an atlas: lightmap UV = UV of the mesh * scale + offset.

    atlas:   name of the atlas
    scale:   factor of the UVs
    offset:  offset of the scaled UVs
    """

    atlas: str
    scale: float = 1.0
    offset: tuple[float, float] = (0.0, 0.0)

    def apply(self, uvs: np.ndarray) -> np.ndarray:
        """Transform UVs of the mesh to lightmap UVs, (..., 2) float32."""
        if (self.scale, self.offset) == (1.0, (0.0, 0.0)):
            return uvs
        return (uvs.astype(np.float64) * self.scale + np.array(self.offset)).astype(np.float32)


def takes_textures(reading: ReadObject, place: UvTransform) -> bool:
    """Return True if textures over an object's lightmap UVs use its place in the atlas.

    Objects that share a mesh have tiles in other atlases; their textures use the mesh's own UVs.
    """
    return place.atlas == reading.atlas


@dataclass(frozen=True)
class ChartBox:
    """Bounding box of charts, with their density.

    low:      smallest corner, (2,) float64 in UV units
    high:     largest corner, (2,) float64 in UV units
    density:  UV length per metre
    """

    low: np.ndarray
    high: np.ndarray
    density: float

    @property
    def size(self) -> np.ndarray:
        """Width and height, (2,) float64, metres."""
        return (self.high - self.low) / self.density

    def place(self, atlas: str, corner: tuple[int, int], scale: float, resolution: int) -> UvTransform:
        """Return the transform that puts the box's lower left corner at a texel of a lightmap.

        corner:      column and row of the texel
        scale:       texels per metre
        resolution:  width of the lightmap, texels
        """
        factor = scale / self.density / resolution
        x, y = np.array(corner) / resolution - self.low * factor
        return UvTransform(atlas, float(factor), (float(x), float(y)))


@dataclass(frozen=True, eq=False)
class Charted:
    """Charts of an object, with their areas in UV space and in the world.

    uvs:        (t, 3, 2) float32, UVs of the triangles' corners
    low:        smallest UVs, (2,) float64
    high:       largest UVs, (2,) float64
    flat_area:  area of the charts, UV units^2
    surface:    area in world space, m^2
    scale:      the object's scale in lightmaps
    """

    uvs: np.ndarray
    low: np.ndarray
    high: np.ndarray
    flat_area: float
    surface: float
    scale: float


def make_charted(uvs: np.ndarray, positions: np.ndarray, matrix: np.ndarray, scale: float) -> Slices[Charted]:
    """Measure the charts of an object.

    uvs:        (t, 3, 2) float32
    positions:  (t, 3, 3) float32, object space
    matrix:     (4, 4) float64, object space to world space
    scale:      the object's scale in lightmaps
    """
    turn = matrix[:3, :3].T
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    flat = surface = 0.0
    for rows in row_slices(len(uvs), 27):
        part = uvs[rows]
        (u1, v1), (u2, v2) = ((part[:, k] - part[:, 0]).T for k in (1, 2))
        flat += float(np.abs(u1 * v2 - u2 * v1).sum(dtype=np.float64)) / 2
        first, second = ((positions[rows, k] - positions[rows, 0]) @ turn for k in (1, 2))
        surface += float(np.linalg.norm(np.cross(first, second), axis=1).sum()) / 2
        for axis in range(2):
            low[axis] = min(low[axis], part[..., axis].min())
            high[axis] = max(high[axis], part[..., axis].max())
        yield rows.stop / len(uvs)
    return Charted(uvs, low, high, flat, surface, scale)


def charted_of(reading: ReadObject) -> Slices[Charted]:
    """Measure the charts of an object or instance with lightmap UVs."""
    corners = reading.mesh.corners
    assert corners.uvs is not None
    return make_charted(corners.uvs, corners.positions, reading.matrix, reading.scale)


def chart_box(charted: Charted) -> ChartBox:
    """Return the box around an object's charts, with their density at its scale in lightmaps."""
    high = np.maximum(charted.high, charted.low + _SMALLEST_BOX)
    flat = max(charted.flat_area, _LEAST_FILLED * float(np.prod(high - charted.low)))
    area = charted.surface * charted.scale**2
    return ChartBox(charted.low, high, float(np.sqrt(flat / area)) if area > 0 else 1.0)
