"""Colors of surfaces for rays of reflection cubes: constants by surface, and textured parts by material."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..scene.cutouts import map_uvs
from ..scene.model import Material, Mesh
from ..scene.texture import Texture


@dataclass(frozen=True)
class TexturedPart:
    """Part of the light of a surface that depends on a texture.

    color:     (3,) float32, factor of the texture
    reflects:  True if it is multiplied by E/pi, False for emission
    """

    color: np.ndarray
    texture: Texture
    reflects: bool


class SurfaceColors:
    """Reflected and emitted light of the 2 m surfaces of m materials.

    Surface i is material i. Surface m + i is its back face if that has no patches: it emits but reflects
    nothing.

    constants:  (4 m, 4) float32, reflectance and emission of each surface without the textured parts
    """

    def __init__(self, materials: Sequence[Material]) -> None:
        self.count = len(materials)
        self.constants = np.zeros((4 * self.count, 4), np.float32)
        self._textured: dict[int, list[TexturedPart]] = {}
        for index, material in enumerate(materials):
            back = material.back or material
            self._add(index, True, material.reflectance, material.reflectance_map)
            self._add(index, True, material.translucency, material.translucency_map)
            self._add(index, False, material.emission, material.emission_map)
            self._add(self.count + index, False, back.emission, back.emission_map)

    @property
    def textured(self) -> dict[int, list[TexturedPart]]:
        """Textured parts of the surfaces that have any."""
        return self._textured

    def _add(self, surface: int, reflects: bool, color: np.ndarray, texture: Texture | None) -> None:
        """Add a part of a surface's light."""
        if texture is None:
            self.constants[2 * surface + (not reflects), :3] += color
        elif color.any():
            part = TexturedPart(color.astype(np.float32), texture, reflects)
            self._textured.setdefault(surface, []).append(part)


def texture_corners(
    meshes: Sequence[Mesh], of_mesh: np.ndarray, triangles: np.ndarray, texture: Texture
) -> np.ndarray:
    """Return the texture UVs of the corners of triangles, (k, 3, 2) float32.

    of_mesh:    (t,) int32, mesh of each triangle of the scene
    triangles:  (k,) int64, ascending
    """
    corners = np.zeros((len(triangles), 3, 2), np.float32)
    for number, first, here in _by_mesh(of_mesh, triangles):
        corners[here] = map_uvs(texture, meshes[number].texture_uvs[texture.uv_map][triangles[here] - first])
    return corners


def _by_mesh(of_mesh: np.ndarray, triangles: np.ndarray) -> Iterator[tuple[int, int, slice]]:
    """Yield each mesh of triangles, its first triangle, and the slice of `triangles` in it."""
    numbers, starts = np.unique(of_mesh[triangles], return_index=True)
    ends = [*starts[1:], len(triangles)]
    for number, start, end in zip(numbers, starts, ends, strict=True):
        yield int(number), int(np.searchsorted(of_mesh, number)), slice(int(start), int(end))
