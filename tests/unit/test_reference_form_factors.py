"""The form-factor matrix: closed rooms, known squares, occluders, and the solver on top of it."""

import numpy as np
import pytest

from engine import Scene
from tests.analytic import scenes
from tests.analytic.drive import prepare
from tests.reference import analytic
from tests.reference.form_factors import form_factors
from tests.reference.gauss_seidel import gauss_seidel


def matrix(scene: Scene, resolution: int):
    prepared = prepare(scene, resolution)
    return prepared, form_factors(prepared.geometry, scene)


def occluded(blocker: np.ndarray) -> Scene:
    """Return a floor, a ceiling 1 m above it, and a rectangle between them."""
    pair = scenes.facing_squares(False).meshes[0].positions
    corners = np.stack([pair[0][[0, 1, 2, 2]], pair[2][[0, 1, 2, 2]], blocker])
    corners[:2, 3] = pair[[1, 3], 2]
    mesh = scenes.quads(corners, [(0, 0, 8, 8), (10, 0, 8, 8), (20, 0, 8, 8)], [0, 0, 0], 32)
    return Scene((mesh,), (scenes.material("Grey", 0.5),))


def test_rows_of_a_closed_box_sum_to_one():
    _, factors = matrix(scenes.furnace(0.5, 1.0), 32)
    assert np.abs(factors.sum(axis=1) - 1).max() < 1e-5


def test_point_formula_is_as_good_as_promised():
    _, factors = matrix(scenes.light_room(), 64)
    assert np.abs(factors.sum(axis=1) - 1).max() < 2e-3


@pytest.mark.parametrize("perpendicular", [False, True])
def test_unit_squares(perpendicular):
    prepared, factors = matrix(scenes.facing_squares(perpendicular), 64)
    floor = prepared.face == 0
    expected = analytic.perpendicular_rectangles if perpendicular else analytic.parallel_rectangles
    assert factors[floor][:, ~floor].sum(axis=1).mean() == pytest.approx(expected(1, 1, 1), rel=2e-3)


def test_reciprocity_of_far_patches():
    prepared, factors = matrix(scenes.facing_squares(False), 64)
    exchange = prepared.geometry.area[:, None] * factors
    assert np.allclose(exchange, exchange.T, rtol=5e-3, atol=0)


def test_a_full_blocker_blocks_all():
    prepared, factors = matrix(occluded(scenes.rectangle((-9, -9, 0.5), (20, 0, 0), (0, 20, 0))), 32)
    floor, ceiling = prepared.face == 0, prepared.face == 1
    assert not factors[floor][:, ceiling].any()


def test_half_a_blocker_leaves_the_lit_half():
    prepared, factors = matrix(occluded(scenes.rectangle((0.5, 0, 0.5), (0.5, 0, 0), (0, 1, 0))), 32)
    floor, ceiling = prepared.face == 0, prepared.face == 1
    center = prepared.geometry.center + prepared.triangles.origin
    crossing = (center[floor][:, None, 0] + center[ceiling][None, :, 0]) / 2
    assert ((factors[floor][:, ceiling] == 0) == (crossing > 0.5))[np.abs(crossing - 0.5) > 1e-5].all()


def test_backs_are_negative():
    prepared, factors = matrix(occluded(scenes.rectangle((0, 0, 0.5), (1, 0, 0), (0, 1, 0))), 32)
    floor, ceiling, sheet = (prepared.face == k for k in range(3))
    assert (factors[floor][:, sheet] < 0).all()
    assert (factors[ceiling][:, sheet] > 0).all()


def test_triangles_that_are_no_parallelogram_block_too():
    sheet = scenes.rectangle((-9, -9, 0.5), (20, 0, 0), (0, 20, 0))
    sheet[3, 0] += 1
    prepared, factors = matrix(occluded(sheet), 32)
    floor, ceiling = prepared.face == 0, prepared.face == 1
    assert not factors[floor][:, ceiling].any()


@pytest.mark.parametrize("reflectance", [0.5, 0.9])
def test_gauss_seidel_solves_the_furnace(reflectance):
    prepared, factors = matrix(scenes.furnace(reflectance, 1.0), 32)
    radiance, sweeps = gauss_seidel(factors, prepared.emission, prepared.reflectance)
    expected = np.full(radiance.shape, analytic.furnace_radiance(1, reflectance))
    assert radiance == pytest.approx(expected, rel=1e-4)
    assert sweeps < 100


def test_gauss_seidel_agrees_with_a_direct_solver():
    random = np.random.default_rng(3)
    factors = random.uniform(-1, 1, (30, 30)).astype(np.float32)
    factors /= np.abs(factors).sum(axis=1, keepdims=True)
    np.fill_diagonal(factors, 0)
    emission, reflectance = random.uniform(0, 1, (2, 30, 3)).astype(np.float32)
    radiance, _ = gauss_seidel(factors, emission, reflectance, tolerance=1e-7)
    for channel in range(3):
        rho = reflectance[:, channel, None]
        system = np.eye(30) - rho * np.maximum(factors, 0)
        source = emission[:, channel] + (rho * np.maximum(-factors, 0)) @ emission[:, channel]
        assert radiance[:, channel] == pytest.approx(np.linalg.solve(system, source), rel=1e-5)


def test_gauss_seidel_stops_at_its_limit():
    prepared, factors = matrix(scenes.furnace(0.9, 1.0), 32)
    assert gauss_seidel(factors, prepared.emission, prepared.reflectance, sweeps=3)[1] == 3
