"""Bound-constrained least squares by preconditioned conjugate gradients (Shewchuk 1994)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

#: Maximum iterations of the unconstrained run and of the run with fixed bounds.
_STEPS, _FEWER = 20, 6

#: Residual, relative to the initial one, at which a run stops.
_TOLERANCE = 5e-3


class Normal(Protocol):
    """A symmetric positive semidefinite matrix: one term of the normal equations."""

    @property
    def diagonal(self) -> np.ndarray:
        """The diagonal, (n,) float64."""

    def times(self, values: np.ndarray) -> np.ndarray:
        """Return the product with a vector, (n,) float64."""


class BoundedCg:
    """Solver of normal equations whose matrix is a sum of terms.

    parts:      the terms; their sum must be positive definite
    tolerance:  residual, relative to the initial one, at which the unconstrained run stops
    steps:      maximum number of its iterations
    """

    def __init__(self, parts: Sequence[Normal], tolerance: float = _TOLERANCE, steps: int = _STEPS) -> None:
        self._parts, self._tolerance, self._steps = parts, tolerance, steps
        self._inverse = 1 / np.sum([part.diagonal for part in parts], axis=0)

    def solution(self, right: np.ndarray, start: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return the approximate least-squares solution, (n,) float64, within the bounds.

        A first run of conjugate gradients ignores the bounds. Values outside are clamped to their bound and
        stay fixed in a second run.

        right:      (n,) float64, right-hand side
        start:      (n,) float64, initial values
        low, high:  (n,) float64, bounds
        """
        enough = self._tolerance**2 * self._energy(right - self._times(start))
        solution = self._run(right, start, np.ones(len(start), bool), enough, self._steps)
        bounded = np.clip(solution, low, high)
        free = bounded == solution
        if free.all():
            return solution
        return np.clip(self._run(right, bounded, free, enough, _FEWER), low, high)

    def _run(
        self, right: np.ndarray, start: np.ndarray, free: np.ndarray, enough: float, steps: int
    ) -> np.ndarray:
        """Return the values after conjugate gradient steps on the free unknowns, with Jacobi preconditioning.

        free:    (n,) bool, True for unknowns that may change
        enough:  preconditioned squared residual at which the run stops
        steps:   maximum number of iterations
        """
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
