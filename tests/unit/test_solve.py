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
    exact = 1 / (1 - rho)
    true = (exact - solution.radiance.mean()) / solution.radiance.mean()
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


def test_residual_is_unknown_after_one_iteration():
    solution = furnace(0.5, iterations=1, tolerance=0.5)
    assert np.isnan(solution.residual) and not solution.converged
