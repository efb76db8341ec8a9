"""Instant radiosity (Keller 1997): virtual point lights along quasi-random particle paths."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from engine.patches.geometry import PatchGeometry
from engine.scene.triangles import Triangles
from engine.visibility.views.hemicube import frames

from .cpu_hemicubes import nearest_hits

#: Height of a virtual light above its surface, as a fraction of the scene's diagonal.
_LIFT = 1e-5

#: Increment of the Weyl sequence for path lengths, independent of the Halton sequence (Weyl 1916).
_GOLDEN = (np.sqrt(5) - 1) / 2

#: Bases of the Halton sequence: one for the triangle, two for the point on it, then two per bounce for the
#: direction.
_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, 83, 89, 97)


class InstantRadiosity:
    """Virtual point lights of a scene, and their irradiance at its patches.

    polygon:      (t,) int, planar polygon of each triangle
    emission:     (t, 3) float, radiance of each triangle's front
    reflectance:  (t, 3) float
    nearest:      minimum distance in the irradiance formula, metres, because 1 / r^2 is unbounded

    For small scenes only: every shadow ray is tested against every triangle.
    """

    def __init__(
        self,
        triangles: Triangles,
        geometry: PatchGeometry,
        polygon: np.ndarray,
        emission: np.ndarray,
        reflectance: np.ndarray,
        nearest: float,
    ) -> None:
        self._triangles, self._polygon, self._nearest = triangles, polygon, nearest
        self._center, self._facing = geometry.center.astype(np.float64), geometry.normal.astype(np.float64)
        self._of_patch = polygon[geometry.triangle]
        self._reflectance = reflectance.astype(np.float64)
        corners = triangles.positions.astype(np.float64)
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(cross, axis=1) / 2
        self._normal = cross / (2 * area)[:, None]
        self._flux = np.pi * area[:, None] * emission
        self._chance = self._flux.sum(axis=1) / self._flux.sum()
        self._survival = float((area[:, None] * reflectance).sum() / (3 * area.sum()))

    def estimates(self, particles: int) -> Iterator[tuple[int, np.ndarray]]:
        """Yield the number of lights so far and E/pi of all patches, (n, 3) float64, after each particle.

        After each bounce a fraction of the particles equal to the mean reflectance continues, with their flux
        increased accordingly. Each particle completes its path before the next starts, so every estimate
        includes all bounces.
        """
        total, lights = np.zeros(self._center.shape), 0
        for index in range(1, particles + 1):
            for eye, normal, flux in self._path(index):
                total += self._light(eye, normal, flux)
                lights += 1
            yield lights, total / index

    def _bounces(self, index: int) -> int:
        """Return the bounces of a particle: a fraction survival^k has at least k (Russian roulette)."""
        rank = index * _GOLDEN % 1.0
        return min(int(np.log(rank) / np.log(self._survival)), (len(_PRIMES) - 3) // 2)

    def _path(self, index: int) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Yield position, normal and flux, W, of the lights of a particle, each (3,) float64."""
        bounces = self._bounces(index)
        halton = [radical_inverse(index, prime) for prime in _PRIMES[: 3 + 2 * bounces]]
        triangle = int(np.searchsorted(np.cumsum(self._chance), halton[0]))
        root = np.sqrt(halton[1])
        weights = np.array([1 - root, root * (1 - halton[2]), root * halton[2]])
        position = weights @ self._triangles.positions[triangle].astype(np.float64)
        flux = self._flux[triangle] / self._chance[triangle]
        for bounce in range(bounces + 1):
            normal = self._normal[triangle]
            eye = position + _LIFT * self._triangles.diagonal * normal
            yield eye, normal, flux
            if bounce == bounces:
                return
            direction = _cosine_direction(normal, *halton[3 + 2 * bounce : 5 + 2 * bounce])
            landed = self._land(eye, direction)
            if landed is None:
                return
            triangle, position = landed
            flux = flux * self._reflectance[triangle] / self._survival

    def _land(self, eye: np.ndarray, direction: np.ndarray) -> tuple[int, np.ndarray] | None:
        """Return the triangle whose front face a ray hits, and the hit point; None if there is none."""
        hit, _, front = nearest_hits(eye, direction[None], self._triangles)
        if hit[0] < 0 or not front[0]:
            return None
        normal, corner = self._normal[hit[0]], self._triangles.positions[hit[0], 0].astype(np.float64)
        return int(hit[0]), eye + direction * ((corner - eye) @ normal) / (direction @ normal)

    def _light(self, eye: np.ndarray, normal: np.ndarray, flux: np.ndarray) -> np.ndarray:
        """Return E/pi of the patches from one light: flux cos cos / (pi^2 r^2) where it is visible."""
        line = self._center - eye
        square = (line * line).sum(axis=1)
        leaving, arriving = line @ normal, -(line * self._facing).sum(axis=1)
        lit = np.flatnonzero((leaving > 0) & (arriving > 0))
        hit, _, front = nearest_hits(eye, line[lit], self._triangles)
        lit = lit[(hit >= 0) & front & (self._polygon[hit] == self._of_patch[lit])]
        light = np.zeros(line.shape)
        cosines = leaving[lit] * arriving[lit] / square[lit]
        light[lit] = (cosines / (np.pi**2 * np.maximum(square[lit], self._nearest**2)))[:, None] * flux
        return light


def radical_inverse(index: int, base: int) -> float:
    """Return the radical inverse of an index in a base (van der Corput 1935, Halton 1960)."""
    value, digit = 0.0, 1.0
    while index:
        digit /= base
        value += digit * (index % base)
        index //= base
    return value


def _cosine_direction(normal: np.ndarray, u: float, v: float) -> np.ndarray:
    """Return a cosine-distributed direction about a normal, (3,) float64, from u, v in [0, 1)."""
    radius, angle = np.sqrt(u), 2 * np.pi * v
    local = np.array([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - u)])
    direction: np.ndarray = local @ frames(normal[None], np.zeros(1))[0]
    return direction
