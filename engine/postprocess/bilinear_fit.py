"""The lightmap whose bilinear display is nearest to the light at points, and the same on both sides of seams.

Kavan, Bargteil and Sloan, Least Squares Vertex Baking (EGSR 2011), with texels in place of vertices; seams as
equations: Iwanicki, Lighting Technology of "The Last of Us" (SIGGRAPH 2013).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..patches.seams import Seams
from .bilinear_equations import display_equations
from .bounded_cg import BoundedCg
from .lightmap_points import LightmapPoints

#: Texels may leave the range of the points around them by this part of it.
_OVERSHOOT = 0.02


class BilinearFit:
    """Texels of lightmaps from the light at points.

    resolution  width and height of the lightmaps
    atlases     number of lightmaps
    points      where the light is known. A texel whose only point is its centre, and that no seam touches,
                gets the bits of that point's light
    known       (atlases, r, r) bool, texels that the fit gives a value
    """

    def __init__(self, resolution: int, atlases: int, points: LightmapPoints, seams: Seams) -> None:
        self._equations = display_equations(points, seams, resolution, atlases)
        equations = self._equations
        self._solver = BoundedCg([equations.points, equations.seams, equations.smooth])
        self._texel = points.texels(resolution)
        self.known = np.zeros((atlases, resolution, resolution), bool)
        self.known.ravel()[self._texel] = self.known.ravel()[equations.texel] = True

    def images(self, values: np.ndarray) -> np.ndarray:
        """Return lightmaps of the light at the points, (s, c) float32, as (atlases, r, r, c) float32.

        0 where the fit knows nothing. No texel leaves the range of the points around it by more than 2 % of
        that range, nor the range of all points.
        """
        images = np.zeros((self.known.size, values.shape[1]), np.float32)
        images[self._texel] = values
        if len(self._equations.texel):
            for channel in range(values.shape[1]):
                images[self._equations.texel, channel] = self._fitted(values[:, channel].astype(np.float64))
        return images.reshape(*self.known.shape, values.shape[1])

    def _fitted(self, values: np.ndarray) -> np.ndarray:
        """Return the unknowns, (n,) float64, of one channel, (s,)."""
        equations = self._equations
        light = values[equations.point]
        right = self._spread(light)
        weight = self._spread(np.ones(len(light)))
        mean = np.divide(right, weight, out=np.zeros_like(right), where=weight > 0)
        start, known = equations.smooth.carried(mean, weight > 0)
        start, _ = equations.seams.carried(start, known)
        return self._solver.solution(right, start, *self._bounds(light))

    def _spread(self, light: np.ndarray) -> np.ndarray:
        """Return the sums of the light of points, (m,), over their footprints, (n,) float64."""
        equations = self._equations
        terms = equations.weights * light[:, None]
        return np.bincount(equations.footprints.ravel(), terms.ravel(), len(equations.texel))

    def _bounds(self, light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the bounds of the unknowns, two (n,) float64 arrays, for the light of their points."""
        order, start, unknown = self._by_unknown
        low, high = np.full(len(self._equations.texel), np.inf), np.full(len(self._equations.texel), -np.inf)
        low[unknown] = np.minimum.reduceat(light[order], start)
        high[unknown] = np.maximum.reduceat(light[order], start)
        for part in (self._equations.points, self._equations.seams):
            low, high = part.widened(low, high)
        slack = _OVERSHOOT * (high - low)
        return np.maximum(low - slack, light.min()), np.minimum(high + slack, light.max())

    @cached_property
    def _by_unknown(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points ordered by the unknown that they read most of, where each one's start, and which it is."""
        largest = self._equations.weights.argmax(axis=1)[:, None]
        nearest = np.take_along_axis(self._equations.footprints, largest, axis=1)[:, 0]
        order = np.argsort(nearest, kind="stable")
        unknown, start = np.unique(nearest[order], return_index=True)
        return order, start, unknown
