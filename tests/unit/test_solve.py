import numpy as np
import pytest

from engine.settings import Settings
from engine.solve import Jacobi


def furnace(rho, **settings):
    ones = np.ones((4, 3), np.float32)
    solution = Jacobi(rho * ones, ones, np.full(4, 0.25, np.float32), Settings(**settings))
    while not solution.done:
        solution.update(solution.radiance)
    return solution


@pytest.mark.parametrize("rho", [0.6, 0.9])
def test_estimated_residual_is_the_true_remaining_error(rho):
    solution = furnace(rho, iterations=12, tolerance=0)
    gathered = (solution.radiance.mean() - 1) / rho
    true = (1 / (1 - rho) - gathered) / gathered
    assert solution.iterations == 12
    assert solution.residual == pytest.approx(true, rel=0.02)


def test_stops_at_the_tolerance_and_sums_the_energy():
    solution = furnace(0.5, iterations=100, tolerance=0.001)
    assert solution.converged and solution.iterations < 14
    assert solution.residual <= 0.001
    # Flux beyond the emission: pi * (B - e) * area, summed over the channels.
    assert sum(solution.energies) == pytest.approx(np.pi * 3 * (solution.radiance.mean() - 1), rel=1e-6)
    assert (np.diff(solution.energies) < 0).all()


def test_limit_counts_and_black_scene_converges():
    assert furnace(0.9, iterations=3, tolerance=1e-9).iterations == 3
    dark = Jacobi(np.ones((2, 3), np.float32), np.zeros((2, 3), np.float32), np.ones(2), Settings())
    dark.update(np.zeros((2, 3), np.float32))
    assert dark.residual == 0 and dark.converged


def test_a_bright_lamp_does_not_hide_the_error_of_what_it_lights():
    """Two patches that light each other beside a lamp that is a million times brighter."""
    emission = np.float32([[1], [1], [1e6]]) * np.ones(3, np.float32)
    solution = Jacobi(np.full((3, 3), 0.9, np.float32), emission, np.ones(3), Settings(tolerance=0.01))
    while not solution.done:
        solution.update(solution.radiance[[1, 0, 0]])
    assert solution.radiance[0, 0] == pytest.approx(10, rel=0.02)


def test_residual_is_unknown_after_one_iteration():
    solution = furnace(0.5, iterations=1, tolerance=0.5)
    assert np.isnan(solution.residual) and not solution.converged
