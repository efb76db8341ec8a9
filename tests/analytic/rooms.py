"""Closed rooms, and the light that a lightmap shows behind walls, beside them and under objects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from engine import BakeResult, Light, Mesh, Scene
from tests.analytic.scenes import GAP, material, quads, rectangle

#: Width of a texel, m.
TEXEL = 0.04


class Atlas:
    """Places the charts of boxes and rooms in rows, whole texels wide, `GAP` apart."""

    def __init__(self, resolution: int) -> None:
        self.resolution = resolution
        self._x = self._y = self._height = 0

    def charts(self, corners: np.ndarray) -> list[tuple[int, int, int, int]]:
        """Return a chart for each quad, (q, 4, 3), of the size that it has in the world."""
        return [self._chart(quad) for quad in corners]

    def _chart(self, quad: np.ndarray) -> tuple[int, int, int, int]:
        edges = np.linalg.norm(quad[[1, 3]] - quad[0], axis=1)
        width, height = np.maximum(np.rint(edges / TEXEL), 1).astype(int)
        if self._x + width > self.resolution:
            self._x, self._y, self._height = 0, self._y + self._height + GAP, 0
        chart = self._x, self._y, width, height
        self._x, self._height = self._x + width + GAP, max(self._height, height)
        if self._y + self._height > self.resolution:
            raise ValueError("The charts do not fit.")
        return chart


def box_faces(low: Sequence[float], high: Sequence[float]) -> np.ndarray:
    """Return the faces of a box, (6, 4, 3): floor, ceiling, left, right, front, back, all facing inwards."""
    (x, y, z), low = np.diag(np.subtract(high, low)), np.asarray(low, float)
    faces = [
        rectangle((0, 0, 0), x, y),
        rectangle(x + z, -x, y),
        rectangle((0, 0, 0), y, z),
        rectangle(x + y, -y, z),
        rectangle(x, -x, z),
        rectangle(y, x, z),
    ]
    return np.stack(faces) + low


def room(atlas: Atlas, low: Sequence[float], high: Sequence[float], name: str) -> Mesh:
    """Return a room that is seen from inside; face 0 is its floor."""
    faces = box_faces(low, high)
    return quads(faces, atlas.charts(faces), [0] * 6, atlas.resolution, name)


def block(atlas: Atlas, low: Sequence[float], high: Sequence[float], name: str, surface: int = 0) -> Mesh:
    """Return a box that is seen from outside."""
    faces = box_faces(low, high)[:, ::-1]
    return quads(faces, atlas.charts(faces), [surface] * 6, atlas.resolution, name)


def lamp(position: Sequence[float], intensity: float = 1.0) -> Light:
    """Return a point lamp without a size, of an intensity in W/sr."""
    strength = np.full(3, intensity, np.float32)
    return Light("Lamp", "point", np.asarray(position, float), np.eye(3), strength)


def scene_of(meshes: Sequence[Mesh], lights: Sequence[Light] = (), reflectance: float = 0.5, **more) -> Scene:
    """Return a scene of one grey."""
    return Scene(tuple(meshes), (material("Grey", reflectance),), lights=tuple(lights), **more)


def floor_points(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """Return where points, (n, 2) m, of a mesh's face 0 are on its lightmap, (n, 2) of [0, 1]."""
    corners, uvs = mesh.positions[:2, :, :2].reshape(-1, 2), mesh.uvs[:2].reshape(-1, 2)
    low, high = corners.min(axis=0), corners.max(axis=0)
    first, last = uvs.min(axis=0), uvs.max(axis=0)
    uv: np.ndarray = first + (points - low) / (high - low) * (last - first)
    return uv


def shown(lightmap: BakeResult, uvs: np.ndarray) -> np.ndarray:
    """Return values of the first lightmap at UVs, (n, 2), as displayed by bilinear interpolation, (n,)."""
    image = lightmap.display[0].mean(axis=-1)
    at = uvs * image.shape[0] - 0.5
    corner = np.floor(at).astype(int)
    u, v = (at - corner).T
    x, y = np.clip(corner.T, 0, image.shape[0] - 2)
    rows = [(1 - u) * image[y + step, x] + u * image[y + step, x + 1] for step in (0, 1)]
    value: np.ndarray = (1 - v) * rows[0] + v * rows[1]
    return value


def lamp_light(position: Sequence[float], points: np.ndarray) -> np.ndarray:
    """Return E/pi of a lamp of 1 W/sr at points, (n, 2), of the floor z = 0, (n,)."""
    to_lamp = np.asarray(position) - np.c_[points, np.zeros(len(points))]
    distance = np.linalg.norm(to_lamp, axis=1)
    light: np.ndarray = to_lamp[:, 2] / distance**3 / np.pi
    return light
