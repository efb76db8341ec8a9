"""Conjugate gradients for least squares whose unknowns have bounds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

#: Steps of the first run at most, and of the one with bounds.
_STEPS, _FEWER = 20, 6

#: The part of the first residual at which a run ends.
_TOLERANCE = 5e-3


class Normal(Protocol):
    """A part of the matrix of normal equations."""

    @property
    def diagonal(self) -> np.ndarray:
        """The diagonal, (n,) float64."""

    def times(self, values: np.ndarray) -> np.ndarray:
        """Return the product with values, (n,) float64."""


class BoundedCg:
    """Solves the normal equations of a sum of matrices.

    parts  the matrices; their sum is positive definite
    """

    def __init__(self, parts: Sequence[Normal]) -> None:
        self._parts = parts
        self._inverse = 1 / np.sum([part.diagonal for part in parts], axis=0)

    def solution(self, right: np.ndarray, start: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return the unknowns, (n,) float64, near the least squares within bounds.

        right, start, low, high  (n,) float64

        What a run of conjugate gradients leaves out of bounds is held at its bound in a second one.
        """
        enough = _TOLERANCE**2 * self._energy(right - self._times(start))
        solution = self._run(right, start, np.ones(len(start), bool), enough, _STEPS)
        bounded = np.clip(solution, low, high)
        free = bounded == solution
        if free.all():
            return solution
        return np.clip(self._run(right, bounded, free, enough, _FEWER), low, high)

    def _run(
        self, right: np.ndarray, start: np.ndarray, free: np.ndarray, enough: float, steps: int
    ) -> np.ndarray:
        """Change the free unknowns by conjugate gradients, preconditioned by the diagonal (Shewchuk 1994)."""
        solution, residual = start, (right - self._times(start)) * free
        direction = residual * self._inverse
        energy = float(residual @ direction)
        for _ in range(steps):
            if energy <= enough:
                break
            change = self._times(direction) * free
            step = energy / float(direction @ change)
            solution = solution + step * direction
            residual = residual - step * change
            energy, before = self._energy(residual), energy
            direction = residual * self._inverse + energy / before * direction
        return solution

    def _energy(self, residual: np.ndarray) -> float:
        return float(residual @ (residual * self._inverse))

    def _times(self, values: np.ndarray) -> np.ndarray:
        product = self._parts[0].times(values)
        for part in self._parts[1:]:
            product += part.times(values)
        return product
