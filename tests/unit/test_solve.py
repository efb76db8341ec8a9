import dataclasses

import numpy as np
import pytest

from engine.errors import SettingsError
from engine.settings import Settings, check_settings
from engine.solve.anderson import COLUMNS, Anderson
from engine.solve.host_radiosity import HostRadiosity
from engine.solve.radiosity_state import PLAIN_COLUMNS, SolvedSurfaces, StartLight
from engine.solve.solver import Solver


class Views:
    """Gathers with a matrix of form factors, (n, n)."""

    def __init__(self, factors):
        self._factors = np.asarray(factors)

    def gather(self, radiance):
        yield 0.5
        seen = self._factors.sum(axis=1, keepdims=True)
        return np.concatenate([self._factors @ radiance, seen], axis=1).astype(np.float32)


def solve(
    factors,
    reflectance,
    emission,
    settings,
    accelerate=False,
    area=None,
    sampled_light=None,
    gathers_direct=True,
    fronts=None,
):
    count = len(factors)
    colours = [np.broadcast_to(np.float32(x).reshape(-1, 1), (count, 3)) for x in (reflectance, emission)]
    sampled_light = np.zeros((count, 3), np.float32) if sampled_light is None else sampled_light
    area = np.full(count, 1 / count, np.float32) if area is None else area
    columns, start = COLUMNS if accelerate else PLAIN_COLUMNS, StartLight(sampled_light, gathers_direct)
    radiosity = HostRadiosity(
        Views(factors), SolvedSurfaces(colours[0], area, fronts=fronts), colours[1], start, columns
    )
    solution = Solver(radiosity, start, settings)
    while not solution.done:
        for _ in solution.iteration():
            pass
    return solution, radiosity


def furnace(rho, accelerate=False, **settings):
    return solve(np.full((4, 4), 0.25), rho, 1.0, Settings(**settings), accelerate)


def chain(count=8):
    """Return form factors of rooms in a row, each open to its neighbours: light spreads slowly."""
    factors = np.eye(count) * 0.6 + np.eye(count, k=1) * 0.2 + np.eye(count, k=-1) * 0.2
    factors[0, 0] = factors[-1, -1] = 0.8
    return factors


@pytest.mark.parametrize("rho", [0.6, 0.9])
def test_estimated_residual_is_the_true_remaining_error(rho):
    solution, _ = furnace(rho, max_bounces=12, tolerance=0)
    true = (1 / (1 - rho) - solution.irradiance.mean()) / solution.irradiance.mean()
    assert solution.iterations == 12
    assert solution.residual == pytest.approx(true, rel=0.02)


def test_back_faces_do_not_lower_the_estimated_residual():
    """Four back faces see nothing, so their light never changes."""
    factors = np.zeros((8, 8))
    factors[:4, :4] = 0.25
    settings = Settings(max_bounces=5, tolerance=0)
    (alone, _), (fronts, _), (together, _) = (
        solve(factors[:n, :n], 0.6, 1.0, settings, fronts=k) for n, k in ((4, None), (8, 4), (8, None))
    )
    assert fronts.residual == pytest.approx(alone.residual, rel=1e-6)
    assert together.residual == pytest.approx(alone.residual / 2, rel=1e-6)


def test_stops_at_the_tolerance_and_sums_the_energy():
    solution, radiosity = furnace(0.5, max_bounces=100, tolerance=0.001)
    assert solution.converged and solution.iterations < 14
    assert solution.residual <= 0.001
    # Flux beyond the emission: pi * (B - e) * area, summed over the channels.
    assert sum(solution.energies) == pytest.approx(np.pi * 3 * (radiosity.radiance.mean() - 1), rel=1e-6)
    assert (np.diff(solution.energies) < 0).all()


def test_limit_counts_and_black_scene_converges():
    assert furnace(0.9, max_bounces=3, tolerance=1e-9)[0].iterations == 3
    for accelerate in (False, True):
        dark, _ = solve(np.full((2, 2), 0.5), 1.0, 0.0, Settings(), accelerate)
        assert dark.residual == 0 and dark.converged and dark.iterations == 1


@pytest.mark.parametrize("accelerate", [False, True])
def test_a_bright_lamp_does_not_hide_the_error_of_what_it_lights(accelerate):
    """Two patches that light each other beside a lamp that is a million times brighter."""
    _, radiosity = solve(
        np.eye(3)[[1, 0, 0]], 0.9, [1, 1, 1e6], Settings(tolerance=0.01), accelerate, np.ones(3)
    )
    assert radiosity.radiance[0, 0] == pytest.approx(10, rel=0.02)


def test_residual_is_unknown_after_one_iteration():
    solution, _ = furnace(0.5, max_bounces=1, tolerance=0.5)
    assert np.isnan(solution.residual) and not solution.converged


def room_beside_lit_ground(rho, room=23, ground=114):
    """Return factors, reflectance and lights of a closed room, and of lit ground that none sees."""
    count = room + ground
    factors = np.zeros((count, count))
    factors[:room, :room] = 1 / room
    lights = np.repeat(np.float32([1, 7])[:, None], 3, axis=1)[np.arange(count) % 3 % 2]
    lights[:room] = 1
    return factors, np.where(np.arange(count) < room, rho, 0.5), lights


@pytest.mark.parametrize("rho", [0.2, 0.9])
def test_ground_without_bounces_does_not_hide_the_error_of_a_closed_room(rho):
    """The light of five patches out of six has settled; one in six goes on reflecting."""
    factors, reflectance, lights = room_beside_lit_ground(rho)
    settings = Settings(max_bounces=200, tolerance=0.001)
    solution, _ = solve(factors, reflectance, 0.0, settings, sampled_light=lights, gathers_direct=True)
    true = np.linalg.solve(np.eye(len(lights)) - factors * reflectance, lights[:, 0])
    error = (np.abs(solution.irradiance[:, 0] - true) / true).mean()
    assert error == pytest.approx(solution.residual, rel=0.1) and solution.converged


@pytest.mark.parametrize("gathers_direct", [True, False])
def test_acceleration_finds_the_same_light_in_far_fewer_sweeps(gathers_direct):
    """Rooms in a row of reflectance 0.9, lit at one end by emission or by a lamp."""
    factors, rho = chain(), 0.9
    emission, lights = np.zeros(8), np.zeros((8, 3), np.float32)
    (emission if gathers_direct else lights)[0] = 1
    settings = Settings(max_bounces=400, tolerance=1e-4)
    source = factors @ emission + lights[:, 0]
    true = np.linalg.solve(np.eye(8) - rho * factors, source)
    sweeps = {}
    for accelerate in (False, True):
        solution, _ = solve(
            factors, rho, emission, settings, accelerate, sampled_light=lights, gathers_direct=gathers_direct
        )
        error = np.abs(solution.irradiance[:, 0] - true) / true
        assert error.mean() < 3e-4
        sweeps[accelerate] = solution.iterations
    assert sweeps[True] < sweeps[False] / 5


def test_the_estimate_of_accelerated_sweeps_bounds_their_error():
    factors, rho, emission = chain(), 0.8, np.linspace(1, 2, 8)
    true = np.linalg.solve(np.eye(8) - rho * factors, factors @ emission)
    for sweeps in range(3, 9):
        settings = Settings(max_bounces=sweeps, tolerance=0)
        solution, _ = solve(factors, rho, emission, settings, accelerate=True)
        error = (np.abs(solution.irradiance[:, 0] - true) / true).mean()
        assert error < 4 * solution.residual + 1e-6


@pytest.mark.parametrize("accelerate", [False, True])
def test_direct_light_is_what_the_first_sweep_gathers(accelerate):
    solution, _ = furnace(0.5, accelerate=accelerate, max_bounces=20, tolerance=0)
    assert solution.direct == pytest.approx(np.ones((4, 3)))
    assert solution.indirect == pytest.approx(np.ones((4, 3)), rel=1e-3)


def test_weights_sum_to_one_and_a_grown_defect_starts_afresh():
    anderson, random = Anderson(), np.random.default_rng(0)
    defects = random.normal(size=(COLUMNS, 50, 3))

    def weights(newest, size=1.0):
        differences = size * (defects - defects[newest])
        differences[newest] = size * defects[newest]
        return anderson.weights(newest, np.einsum("inc,jnc->ijc", differences, differences))

    for column in range(COLUMNS):
        mixed = weights(column)
        assert mixed.sum(axis=0) == pytest.approx(np.ones(3))
        assert (np.abs(mixed) > 0).any(axis=1).sum() == column + 1
    assert (weights(0, size=100.0)[1:] == 0).all()


def test_acceleration_needs_float32_only():
    """Dependent iterates, and channels without light, leave finite weights."""
    products = np.zeros((COLUMNS, COLUMNS, 3))
    products[..., 0] = 1.0
    anderson = Anderson()
    for column in range(COLUMNS):
        assert np.isfinite(anderson.weights(column, products)).all()


def test_settings_name_what_is_wrong():
    for name in ("visibility", "directions"):
        with pytest.raises(SettingsError, match=name):
            check_settings(dataclasses.replace(Settings(), **{name: "magic"}))


@pytest.mark.parametrize("accelerate", [False, True])
def test_patches_send_out_what_others_reflect_that_stand_in_for_them(accelerate):
    """Two patches nobody lights, of which the others see one: it sends out the light of the third."""
    random = np.random.default_rng(7)
    factors, substitute = random.random((7, 7)), np.array([0, 1, 2, 3, 4, 2, 6])
    factors[5] = 0
    factors /= np.maximum(factors.sum(axis=1, keepdims=True), 1e-9)
    rho, emission = np.linspace(0.3, 0.9, 7), np.array([1, 0, 0, 2, 0, 0.5, 0])
    colours = [np.repeat(np.float32(x)[:, None], 3, axis=1) for x in (rho, emission)]
    nothing, area = np.zeros((7, 3), np.float32), np.full(7, 1 / 7, np.float32)
    columns, start = COLUMNS if accelerate else PLAIN_COLUMNS, StartLight(nothing)
    surfaces = SolvedSurfaces(colours[0], area)
    radiosity = HostRadiosity(Views(factors), surfaces, colours[1], start, columns)
    told = []
    solver = Solver(
        radiosity, start, Settings(max_bounces=400, tolerance=1e-6),
        choose_substitutes=lambda seen: told.append(seen.light_of(np.arange(7))) or substitute,
    )  # fmt: skip
    while not solver.done:
        for _ in solver.iteration():
            pass
    sent = np.linalg.solve(np.eye(7) - (rho[:, None] * factors)[substitute], emission)
    assert solver.irradiance[:, 0] == pytest.approx(factors @ sent, rel=1e-4)
    assert radiosity.radiance[:, 0] == pytest.approx(sent, rel=1e-4)
    assert len(told) == 1 and told[0][:, 0] == pytest.approx(factors @ emission, rel=1e-5)


class FewViews(Views):
    """Gathers from one factor of eight, eight times as large, while a radiosity is sparse."""

    def __init__(self, factors):
        super().__init__(factors)
        self.of = None
        self.full = 0
        kept = np.random.default_rng(3).random(self._factors.shape) < 1 / 8
        self._few = self._factors * kept
        self._few *= self._factors.sum(axis=1, keepdims=True) / self._few.sum(axis=1, keepdims=True)

    def gather(self, radiance):
        if not self.of.sparse:
            self.full += 1
            return (yield from super().gather(radiance))
        return (yield from Views(self._few).gather(radiance))


def solve_sparsely(rho, gathers_direct=False, **settings):
    """Return solver, gather and error of a closed room of 337 patches whose first sweeps are sparse."""
    random = np.random.default_rng(2)
    factors = random.random((337, 337))
    factors /= factors.sum(axis=1, keepdims=True)
    emission = np.repeat(random.random((337, 1)).astype(np.float32) ** 8, 3, axis=1)
    reflectance, area = np.full((337, 3), rho, np.float32), np.full(337, 1 / 337, np.float32)
    gather, start = FewViews(factors), StartLight(np.zeros((337, 3), np.float32), gathers_direct)
    gather.of = radiosity = HostRadiosity(gather, SolvedSurfaces(reflectance, area), emission, start, COLUMNS)
    radiosity.sparse = True
    solver = Solver(radiosity, start, Settings(**settings))
    while not solver.done:
        for _ in solver.iteration():
            pass
    if gathers_direct:
        assert np.allclose(solver.direct, factors @ emission, rtol=1e-5)
    truth = np.linalg.solve(np.eye(337) - rho * factors, emission[:, 0].astype(float))
    return solver, gather, np.abs(solver.irradiance[:, 0] / (factors @ truth) - 1).mean()


@pytest.mark.parametrize("gathers_direct", [False, True])
@pytest.mark.parametrize("rho", [0.3, 0.6, 0.9])
def test_a_few_samples_do_for_all_but_the_last_sweeps(rho, gathers_direct):
    solver, gather, error = solve_sparsely(rho, gathers_direct)
    assert solver.converged and error < Settings().tolerance
    assert 2 <= gather.full - gathers_direct <= 3 < solver.iterations


@pytest.mark.parametrize("limit", [1, 2, 3, 4, 5])
def test_the_last_sweeps_allowed_are_from_all_samples(limit):
    solver, gather, _ = solve_sparsely(0.9, max_bounces=limit)
    assert solver.iterations == limit and gather.full == min(limit, 3)
