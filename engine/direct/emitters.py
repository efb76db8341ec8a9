"""What is sampled as a light: lamps, and triangles that are small and bright; packed for the device."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..patches.geometry import PatchGeometry
from ..scene.model import Light
from ..scene.triangles import Triangles
from .modulation import is_modulated

#: A triangle is sampled if it sends out so many times the mean radiance that surfaces emit.
_BRIGHT = 10.0

#: Sides of the polygon that stands for an ellipse; it has the ellipse's area.
_SIDES = 24

#: Half the spread of an area light, rad, from which on it shines in all directions alike.
_WIDEST = 1.57

#: Kinds, as in kernels/emitters.cl, and float4 a record.
POINT, SUN, TRIANGLE, SKY_MAP = range(4)
RECORD = 7

#: Which of them tells where the lamp's modulation begins (the bits of an int), and the power of its falloff.
MODULATION = 6

#: Emission that differs by less from its mean, relative, is even.
_EVEN = 1e-4

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@dataclass(frozen=True)
class BrightTriangles:
    """Emissive triangles that are sampled as lights.

    triangles      (k,) int, index into `Triangles`
    radiance       (k, 3) float32, mean of each
    even           (k,) bool, it is the same all over the triangle
    emission_left  (n, 3) float32, radiance of each patch that is left to the hemicubes
    """

    triangles: np.ndarray
    radiance: np.ndarray
    even: np.ndarray
    emission_left: np.ndarray


def bright_triangles(
    triangles: Triangles, geometry: PatchGeometry, texel_to_patch: np.ndarray, emission: np.ndarray
) -> BrightTriangles:
    """Choose the triangles that are sampled: small enough, or bright enough, against all that emits.

    texel_to_patch: (atlases, r, r) uint32 index map; emission: (n, 3) float32 radiance of each patch.
    """
    red, green, blue = emission.T
    glowing = np.flatnonzero(red + green + blue)
    triangle, shining = geometry.triangle[glowing], emission[glowing]
    radiance = _mean_radiance(triangles, geometry, texel_to_patch, emission, (triangle, shining))
    first, second = np.moveaxis(triangles.positions[:, 1:] - triangles.positions[:, :1], 1, 0)
    area = np.linalg.norm(np.cross(first, second), axis=1) / 2
    luminance = radiance @ _LUMINANCE
    mean = float((luminance * area).sum(dtype=np.float64) / max(area.sum(dtype=np.float64), 1e-30))
    chosen = (luminance > 0) & (luminance >= _BRIGHT * mean)
    left = emission.copy()
    left[glowing[chosen[triangle]]] = 0
    index = np.flatnonzero(chosen)
    even = _is_even(triangle, shining, radiance)[index]
    return BrightTriangles(index, radiance[index].astype(np.float32), even, left)


def _is_even(triangle: np.ndarray, emission: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Return which triangles emit the same everywhere, (t,) bool; triangle and emission of what glows."""
    largest = mean[triangle].max(axis=1, keepdims=True)
    differs = (np.abs(emission - mean[triangle]) > _EVEN * largest).any(axis=1)
    return np.bincount(triangle[differs], minlength=len(mean)) == 0


def _mean_radiance(
    triangles: Triangles,
    geometry: PatchGeometry,
    texel_to_patch: np.ndarray,
    emission: np.ndarray,
    glowing: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """Return the mean radiance that each triangle emits, (t, 3) float64; of its middle if it has no patch.

    glowing: triangle and emission of the patches that emit.
    """
    count = len(triangles.positions)
    patches = np.bincount(geometry.triangle, minlength=count)
    triangle, shining = glowing
    total = np.stack([np.bincount(triangle, channel, count) for channel in shining.T], axis=1)
    resolution = texel_to_patch.shape[-1]
    x, y = (triangles.uvs.mean(axis=1) * resolution).astype(int).clip(0, resolution - 1).T
    number = texel_to_patch[triangles.atlas, y, x].astype(np.int64)
    there = np.where(number[:, None] > 0, emission[np.maximum(number - 1, 0)], 0)
    mean: np.ndarray = np.where(patches[:, None] > 0, total / np.maximum(patches, 1)[:, None], there)
    return mean


def lamp_records(light: Light, origin: np.ndarray, modulation: int = 0) -> np.ndarray:
    """Return the records of one lamp, (k, RECORD, 4) float32: area lights are made of triangles.

    origin: (3,) float64, metres: positions of the records are relative to it; modulation: where the lamp's
    own begins, see modulation.pack_modulations, 0 for none.
    """
    records = _area_records(light, origin) if light.kind == "area" else _lamp_record(light, origin)
    records[:, MODULATION, 0].view(np.int32)[:] = modulation
    records[:, MODULATION, 1] = light.falloff_power
    if light.profile is not None:
        records[:, 0, 1] *= light.profile.mean @ _LUMINANCE
    return records


def _lamp_record(light: Light, origin: np.ndarray) -> np.ndarray:
    """Return the record of a point, spot or sun."""
    record = np.zeros((1, RECORD, 4), np.float64)
    strength = light.strength.astype(np.float64) / np.pi
    record[0, 0, :3] = SUN if light.kind == "sun" else POINT, strength @ _LUMINANCE, light.casts_shadow
    record[0, 1, :3] = light.position - origin
    record[0, 1, 3] = np.sin(light.half_angle) if light.kind == "sun" else light.radius
    record[0, 2, :3] = -light.axes[2]
    record[0, 2, 3] = np.cos(light.half_angle) if light.kind == "spot" else -2
    record[0, 3, :3] = strength
    record[0, 3, 3] = light.soft
    record[0, 4, :3], record[0, 5, :3] = light.axes[0] / light.stretch[0], light.axes[1] / light.stretch[1]
    record[0, 4, 3], record[0, 5, 3] = light.blend, 1 / light.stretch[2]
    return record.astype(np.float32)


def _area_records(light: Light, origin: np.ndarray) -> np.ndarray:
    """Return the triangles of an area light: two of a rectangle, a fan of an ellipse."""
    if light.ellipse:
        angle = np.linspace(0, 2 * np.pi, _SIDES + 1)
        radius = 0.5 * np.sqrt(2 * np.pi / (_SIDES * np.sin(2 * np.pi / _SIDES)))
        rim = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        outline = np.stack([np.zeros_like(rim[1:]), rim[:-1], rim[1:]], axis=1)
    else:
        outline = np.array([[(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5)], [(-0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]])
    corners = light.position - origin + (outline * light.size) @ light.axes[:2]

    # Wound such that the side along -z is the front.
    corners = corners[:, [0, 2, 1]]
    if np.linalg.det(light.axes) < 0:
        corners = corners[:, [0, 2, 1]]
    records = _triangle_records(corners, np.tile(light.strength, (len(corners), 1)))
    records[:, 0, 2] = light.casts_shadow
    records[:, 0, 3] = light.half_angle >= _WIDEST and not is_modulated(light)
    records[:, 4, 3] = light.half_angle
    surface_numbers(records)[:] = -1
    return records


def surface_records(
    triangles: Triangles, bright: BrightTriangles, culled: np.ndarray, origin: np.ndarray
) -> np.ndarray:
    """Return the records of emissive triangles, (k, RECORD, 4) float32.

    culled: (m,) bool of each material; the back of a culled one is not there and does not shine.
    """
    records = _triangle_records(triangles.positions[bright.triangles] - origin, bright.radiance)
    records[:, 0, 2], records[:, 0, 3] = 1, bright.even
    records[:, 4, 3] = triangles.atlas[bright.triangles]
    records[:, 5, 2] = culled[triangles.material[bright.triangles]]
    surface_numbers(records)[:] = bright.triangles
    return records


def surface_numbers(records: np.ndarray) -> np.ndarray:
    """Return a view of the numbers of triangles in their records, (k,) int32; -1 for parts of area lights.

    They are the bits of float32: counted in it, 16,777,217 would be 16,777,216.
    """
    numbers: np.ndarray = records.view(np.int32)[:, 5, 3]
    return numbers


def sky_record() -> np.ndarray:
    """Return the record of the bright sky, (1, RECORD, 4) float32."""
    record = np.zeros((1, RECORD, 4), np.float32)
    record[0, 0, :3] = SKY_MAP, 0, 1
    return record


def _triangle_records(corners: np.ndarray, radiance: np.ndarray) -> np.ndarray:
    """Return records of triangles, corners (k, 3, 3) metres, radiance (k, 3)."""
    records = np.zeros((len(corners), RECORD, 4), np.float32)
    records[:, 0, 0] = TRIANGLE
    records[:, 0, 1] = radiance @ _LUMINANCE / np.pi
    records[:, 1, :3] = corners[:, 0]
    records[:, 2, :3] = corners[:, 1] - corners[:, 0]
    records[:, 3, :3] = corners[:, 2] - corners[:, 0]
    records[:, 4, :3] = radiance
    return records
