"""Least-squares fit of texels: the bilinear lightmap nearest to light samples and equal across seams.

Kavan, Bargteil and Sloan, "Least Squares Vertex Baking" (EGSR 2011), with texels instead of vertices. Seam
equations: Iwanicki, "Lighting Technology of The Last of Us" (SIGGRAPH 2013).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..patches.seams import Seams
from .bilinear_equations import display_equations
from .bounded_cg import BoundedCg
from .lightmap_points import LightmapPoints

#: Overshoot: fraction of the range of the surrounding samples by which a texel may leave that range.
_OVERSHOOT = 0.02


class BilinearFit:
    """Fits texels of lightmaps to the light at points, by `BoundedCg` on `BilinearEquations`.

    resolution:  width and height of each lightmap, texels
    atlases:     number of lightmaps
    points:      positions of the light samples. A texel with one sample at its centre and no seam keeps that
                 value exactly
    known:       (atlases, r, r) bool, True for texels to which the fit assigns a value
    """

    def __init__(self, resolution: int, atlases: int, points: LightmapPoints, seams: Seams) -> None:
        self._equations = display_equations(points, seams, resolution, atlases)
        equations = self._equations
        self._solver = BoundedCg([equations.points, equations.seams, equations.smooth])
        self._texel = points.texels(resolution)
        self.known = np.zeros((atlases, resolution, resolution), bool)
        self.known.ravel()[self._texel] = self.known.ravel()[equations.texel] = True

    def images(self, values: np.ndarray) -> np.ndarray:
        """Return the fitted lightmaps, (atlases, r, r, c) float32, of light at the points, (s, c).

        Texels outside the fit are 0. A texel leaves the range of the samples around it by at most 2 % of that
        range, and never leaves the range of all samples.
        """
        images = np.zeros((self.known.size, values.shape[1]), np.float32)
        images[self._texel] = values
        if len(self._equations.texel):
            for channel in range(values.shape[1]):
                images[self._equations.texel, channel] = self._fitted(values[:, channel].astype(np.float64))
        return images.reshape(*self.known.shape, values.shape[1])

    def _fitted(self, values: np.ndarray) -> np.ndarray:
        """Return the unknowns, (n,) float64, of one channel of the light at the points, (s,) float64."""
        equations = self._equations
        light = values[equations.point]
        right = self._spread(light)
        weight = self._spread(np.ones(len(light)))
        mean = np.divide(right, weight, out=np.zeros_like(right), where=weight > 0)
        start, known = equations.smooth.carried(mean, weight > 0)
        start, _ = equations.seams.carried(start, known)
        return self._solver.solution(right, start, *self._bounds(light))

    def _spread(self, light: np.ndarray) -> np.ndarray:
        """Return A^T W times the light of points, (m,): weighted sums over each unknown, (n,) float64."""
        equations = self._equations
        terms = equations.weights * light[:, None]
        return np.bincount(equations.footprints.ravel(), terms.ravel(), len(equations.texel))

    def _bounds(self, light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return lower and upper bounds of the unknowns, (n,) float64 each, from light at points, (m,)."""
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
        """Points grouped by the unknown that has the largest weight in their bilinear lookup.

        Returns the point order, (m,), the start of each group in it, and the unknown of each group, (k,)
        each.
        """
        largest = self._equations.weights.argmax(axis=1)[:, None]
        nearest = np.take_along_axis(self._equations.footprints, largest, axis=1)[:, 0]
        order = np.argsort(nearest, kind="stable")
        unknown, start = np.unique(nearest[order], return_index=True)
        return order, start, unknown
