"""Irradiance caching, for comparison: a few patches gather, others interpolate with gradients.

Ward, Rubinstein and Clear, "A Ray Tracing Solution for Diffuse Interreflection" (1988); gradients: Ward and
Heckbert, "Irradiance Gradients" (1992), here computed over the texels of hemicubes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.visibility.views.hemicube import FACES, face_axes, face_rows, multiplier_map

#: Maximum height difference between two points that share light, as a fraction of a record's radius.
_IN_FRONT = 0.05


@dataclass(frozen=True)
class Records:
    """Irradiance records of n points, from hemicubes.

    light:        (n,) float64, E/pi
    translation:  (n, 3) float64, 1/m, gradient of E/pi by position
    rotation:     (n, 3) float64, gradient of E/pi by the normal
    distance:     (n,) float64, metres, harmonic mean distance of visible surfaces
    """

    light: np.ndarray
    translation: np.ndarray
    rotation: np.ndarray
    distance: np.ndarray


def records(width: int, frame: np.ndarray, radiance: np.ndarray, distance: np.ndarray) -> Records:
    """Return the records of hemicubes of a width.

    frame:     (n, 3, 3) float64, see `hemicube.frames`
    radiance:  (n, 3 width, width) float64, radiance of each texel, unfolded layout
    distance:  the same shape, metres along the texel's direction, infinite for background
    """
    weight, axes, spacing = multiplier_map(width).astype(np.float64), face_axes(frame), 2.0 / width
    light = np.einsum("nyx,yx->n", radiance, weight)
    near = np.einsum("nyx,yx->n", 1 / distance, weight)
    translation, rotation = np.zeros((2, len(frame), 3))
    for face, (first, rows) in zip(range(FACES), face_rows(width), strict=True):
        here = slice(first, first + rows)
        u = (np.arange(width) + 0.5) * spacing - 1
        v = (np.arange(rows) + 0.5) * spacing - (1 if face == 0 else 0)
        length = np.sqrt(1 + u**2 + v[:, None] ** 2)
        depth = distance[:, here] / length
        columns = (radiance[:, here], depth, weight[here])
        rows_first = radiance[:, here].swapaxes(1, 2), depth.swapaxes(1, 2), weight[here].T
        translation += _borders(*columns, u, spacing, axes[:, face, [0, 2]])
        translation += _borders(*rows_first, v, spacing, axes[:, face, [1, 2]])

        # The rotational gradient weighs a texel by its solid angle, which is its multiplier divided by the
        # cosine.
        cosine = 1 / length if face == 0 else v[:, None] / length
        part = radiance[:, here] * weight[here] / (cosine * length)
        sums = np.stack(
            [(part * u).sum(axis=(1, 2)), (part * v[:, None]).sum(axis=(1, 2)), part.sum(axis=(1, 2))], axis=1
        )
        rotation += np.einsum("nk,nkd->nd", sums, axes[:, face])
    return Records(light, translation, rotation, 1 / np.maximum(near, 1e-30))


def _borders(
    radiance: np.ndarray,
    depth: np.ndarray,
    weight: np.ndarray,
    place: np.ndarray,
    spacing: float,
    axes: np.ndarray,
) -> np.ndarray:
    """Return the contribution of borders between texel columns to the translational gradient, (n, 3).

    As the viewpoint moves, a border moves on the face with the nearer of its two surfaces, so one texel grows
    at the expense of the other (Ward and Heckbert 1992, for strata of a hemisphere).

    radiance, depth:  (n, rows, columns); depth in metres along the face's axis
    weight:           (rows, columns), multiplier map
    place, spacing:   position and spacing of the columns on the face, at distance 1
    axes:             (n, 2, 3), axis across the columns, and the face's axis
    """
    step = radiance[:, :, :-1] - radiance[:, :, 1:]
    density = (weight[:, :-1] + weight[:, 1:]) / (2 * spacing)
    moved = step * density / np.minimum(depth[:, :, :-1], depth[:, :, 1:])
    border = (place[:-1] + place[1:]) / 2
    forward, across = (moved * border).sum(axis=(1, 2)), -moved.sum(axis=(1, 2))
    gradient: np.ndarray = across[:, None] * axes[:, 0] + forward[:, None] * axes[:, 1]
    return gradient


class IrradianceCache:
    """Irradiance cache among n points.

    points:   (n, 3) float64, metres
    normals:  (n, 3) float64, unit
    found:    records of all points, used only where a point is chosen as a record
    error:    maximum interpolation error (Ward's a): distance over radius plus change of normal
    reaches:  (2,) minimum and maximum radius of a record, metres
    """

    def __init__(
        self,
        points: np.ndarray,
        normals: np.ndarray,
        found: Records,
        error: float,
        reaches: tuple[float, float],
    ) -> None:
        self._points, self._normals, self._found, self._error = points, normals, found, error

        # Irradiance must not change by more than itself within the radius (Krivanek et al. 2005).
        steep = np.linalg.norm(found.translation, axis=1)
        change = np.divide(found.light, steep, out=np.full(len(steep), np.inf), where=steep > 0)
        self._reach = np.clip(np.minimum(found.distance, change), *reaches)

    def fill(self, order: np.ndarray) -> np.ndarray:
        """Return which points become records, (n,) bool.

        In order, (n,) int, each point becomes a record unless an earlier record is valid there.
        """
        chosen = np.zeros(len(order), np.int64)
        count = 0
        for point in order:
            if not self._weights(np.array([point]), chosen[:count]).any():
                chosen[count] = point
                count += 1
        recorded = np.zeros(len(order), bool)
        recorded[chosen[:count]] = True
        return recorded

    def light(self, recorded: np.ndarray) -> np.ndarray:
        """Return E/pi of all points, (n,) float64; records keep their own."""
        chosen, light = np.flatnonzero(recorded), self._found.light.copy()
        for some in np.array_split(np.flatnonzero(~recorded), max(1, len(light) // 256)):
            weights = self._weights(some, chosen)
            way = self._points[some][:, None] - self._points[chosen]
            turn = self._normals[some][:, None] - self._normals[chosen]
            told = self._found.light[chosen] + np.einsum("pcd,cd->pc", way, self._found.translation[chosen])
            told += np.einsum("pcd,cd->pc", turn, self._found.rotation[chosen])
            light[some] = (weights * np.maximum(told, 0)).sum(axis=1) / weights.sum(axis=1)
        return light

    def _weights(self, some: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """Return the weights of records (c,) at points (p,), (p, c) float64.

        0 where a record is not valid.
        """
        way = self._points[some][:, None] - self._points[chosen]
        mine, theirs = self._normals[some], self._normals[chosen]
        turn = np.sqrt(np.maximum(1 - mine @ theirs.T, 0))
        reach = self._reach[chosen]
        off = np.linalg.norm(way, axis=2) / reach + turn
        ahead = np.einsum("pcd,pcd->pc", way, mine[:, None] + theirs) / 2
        serves = (off < self._error) & (np.abs(ahead) < _IN_FRONT * reach)
        return np.where(serves, 1 / np.maximum(off, 1e-6) - 1 / self._error, 0.0)
