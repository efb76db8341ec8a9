"""Hemicubes on the processor: hits, views and integration, without OpenGL or OpenCL."""

import numpy as np
import pytest

from engine import Scene, Settings
from engine.scene.triangles import join_meshes
from engine.visibility.views.hemicube import multiplier_map
from tests.analytic import scenes
from tests.analytic.drive import prepare
from tests.reference import analytic
from tests.reference.cpu_hemicubes import integrate, nearest_hits, texel_directions

SETTINGS = Settings(resolution=32, hemicube=16)


def test_the_nearest_of_two_sheets_is_hit():
    near = scenes.rectangle((0, 0, 1), (1, 0, 0), (0, 1, 0))
    far = scenes.rectangle((0, 0, 2), (0, 2, 0), (2, 0, 0))
    mesh = scenes.quads(np.stack([far, near]), [(0, 0, 8, 8), (10, 0, 8, 8)], [0, 0], 32)
    triangles = join_meshes(Scene((mesh,), (scenes.material("Grey", 0.5),)))
    eye = np.array([0.3, 0.6, 0.0]) - triangles.origin
    directions = np.array([[0, 0, 1], [0.6, 0, 1], [0, 0, -1], [9, 0, 1.0]])
    triangle, uv, front = nearest_hits(eye, directions, triangles)
    assert list(triangle // 2) == [1, 1, -1, -1]
    assert uv[:2] * 32 == pytest.approx(np.array([[10 + 0.3 * 8, 0.6 * 8], [10 + 0.9 * 8, 0.6 * 8]]))
    assert not front[:2].any()
    assert nearest_hits(eye, np.array([[1.2, 0, 1]]), triangles)[2].all()


def test_directions_cover_the_hemisphere_in_the_stacked_layout():
    grids = texel_directions(8)
    assert [len(grid) for grid in grids] == [64, 32, 32, 32, 32]
    assert grids[0][:, 1].min() == -0.875 and grids[1][:, 1].min() == 0.125
    assert np.sum([len(grid) for grid in grids]) == multiplier_map(8).size


def test_integration_of_a_constant_is_the_constant():
    image = np.full((48, 16, 4), 0.75, np.float32)
    assert integrate(image, multiplier_map(16)) == pytest.approx(np.full(4, 0.75), abs=1e-6)


def test_integration_is_the_weighted_sum():
    image = np.random.default_rng(1).uniform(0, 3, (96, 32, 4)).astype(np.float32)
    multiplier = multiplier_map(32)
    expected = np.einsum("yxc,yx->c", image.astype(float), multiplier)
    assert integrate(image, multiplier) == pytest.approx(expected, rel=1e-5)


def test_inside_a_box_everything_is_front_and_owned():
    prepared = prepare(scenes.furnace(0.5, 1.0), 32)
    hemicubes = prepared.hemicubes(SETTINGS)
    for patch in range(1, len(prepared.patches), 7):
        view = hemicubes.view(patch)
        assert (view.facing == 1).all()
        assert (view.patch > 0).all()
        assert prepared.face[patch] not in prepared.face[view.patch - 1]


def test_a_patch_sees_what_is_above_it():
    prepared = prepare(scenes.facing_squares(False), 64)
    patch = int(np.flatnonzero(prepared.face == 0)[100])
    view = prepared.hemicubes(Settings(resolution=64, hemicube=32)).view(patch)
    middle = view.patch[15:17, 15:17] - 1
    offset = prepared.geometry.center[middle] - prepared.geometry.center[patch]
    assert np.abs(offset[..., :2]).max() < 0.08
    assert offset[..., 2] == pytest.approx(np.ones((2, 2)))


@pytest.mark.parametrize(("height", "seen"), [(1, [2, 2, 2, 0]), (-1, [0.25, 0.5, 1, 1])])
def test_backs_send_emission_only_and_the_world_is_seen_where_nothing_is(height, seen):
    floor = scenes.rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0))
    sheet = scenes.rectangle((-50, -50, height), (100, 0, 0), (0, 100, 0))
    mesh = scenes.quads(np.stack([floor, sheet]), [(0, 0, 4, 4), (6, 0, 4, 4)], [0, 1], 32)
    materials = scenes.material("Black", 0.0), scenes.material("Glow", 0.5, 2.0)
    prepared = prepare(Scene((mesh,), materials, world=np.array([0.25, 0.5, 1.0], np.float32)), 32)
    hemicubes = prepared.hemicubes(SETTINGS)
    patch = int(np.flatnonzero(prepared.face == 0)[5])
    image = hemicubes.image(hemicubes.view(patch), np.full((32, 3), 100.0, np.float32))
    assert image[:16].reshape(-1, 4) == pytest.approx(np.tile(seen, (256, 1)))


@pytest.mark.parametrize("perpendicular", [False, True])
def test_unit_squares(perpendicular):
    prepared = prepare(scenes.facing_squares(perpendicular, side=8), 64)
    hemicubes = prepared.hemicubes(Settings(resolution=64, hemicube=32))
    floor = np.flatnonzero(prepared.face == 0)
    gathered = hemicubes.gather_views([hemicubes.view(int(patch)) for patch in floor], prepared.emission)
    expected = analytic.perpendicular_rectangles if perpendicular else analytic.parallel_rectangles
    assert gathered[:, 0].mean() == pytest.approx(expected(1, 1, 1), rel=0.01)
