from dataclasses import replace

import numpy as np
import pytest

from engine.scene.model import Light, Scene
from engine.scene.triangles import bounding_box, join_meshes
from tests.analytic.scenes import material, quads, rectangle, room_walls

GREY = material("Grey", 0.5)


def room(position, name):
    """Return a room of 3 x 5 x 7 m whose low corner is at a position."""
    return quads(room_walls(3, 5, 7) + np.array(position), [(0, 0, 1, 1)] * 6, [0] * 6, 7, name)


def test_the_median_corner_becomes_the_origin_however_far_away_some_meshes_are():
    """Two rooms side by side, and a square at 1e8 m: the rooms keep every digit of theirs."""
    far = quads(rectangle((1e8, 1e8, -1e8), (11, 0, 0), (0, 13, 0))[None], [(0, 0, 1, 1)], [0], 7, "Far")
    scene = Scene((room((1024, -2048, 512), "One"), room((1027, -2048, 512), "Two"), far), (GREY,))
    triangles = join_meshes(scene)
    assert np.abs(triangles.origin - (1027, -2045, 515)).max() <= 5
    assert (triangles.origin.astype(np.float32) == triangles.origin).all()
    assert np.abs(triangles.positions[triangles.mesh < 2]).max() <= 10
    for index, mesh in enumerate(scene.meshes[:2]):
        assert (triangles.positions[triangles.mesh == index] + triangles.origin == mesh.positions).all()
    assert triangles.mesh.tolist() == [0] * 12 + [1] * 12 + [2] * 2


@pytest.mark.parametrize("atlases", [(0, 1, 2), (1, 0, 1), (2, 2, 0)])
def test_triangles_of_an_atlas_are_a_slice_if_they_are_adjacent(atlases):
    meshes = tuple(replace(room((0, 0, 9 * k), f"{k}"), atlas=atlas) for k, atlas in enumerate(atlases))
    triangles = join_meshes(Scene(meshes, (GREY,), atlases=("A", "B", "C")))
    for atlas in range(3):
        chosen = triangles.in_atlas(atlas)
        assert np.arange(36)[chosen].tolist() == np.flatnonzero(triangles.atlas == atlas).tolist()
        assert isinstance(chosen, slice) == (atlases != (1, 0, 1) or atlas != 1)


def test_the_scene_stays_as_it_was():
    scene = Scene((room((31, 37, 41), "One"),), (GREY,))
    before = scene.meshes[0].positions.copy()
    join_meshes(scene)
    assert (scene.meshes[0].positions == before).all()


@pytest.mark.parametrize("away", [0.0, 3e5])
def test_diagonal_and_box_are_those_of_all_meshes(away):
    scene = Scene((room((away, 0, 0), "One"), room((away, 11, 0), "Two")), (GREY,))
    triangles = join_meshes(scene)
    assert triangles.diagonal == pytest.approx(np.linalg.norm([3, 16, 7]), rel=1e-6)
    assert triangles.box + triangles.origin == pytest.approx(np.array([[away, 0, 0], [away + 3, 16, 7]]))


def test_lights_move_with_the_triangles():
    """In float64: a lamp stays between walls that float32 holds to 8 m only."""
    lamp = Light("Lamp", "point", np.array([1e8 + 0.3, 0, 0]), np.eye(3), np.ones(3, np.float32))
    moved = lamp.relative_to(np.array([1e8, 0, -2]))
    assert moved.position == pytest.approx([0.3, 0, 2], abs=1e-7)


def test_charts_of_nearly_no_area_have_no_huge_texels():
    """Of three squares: one with a chart, one whose chart is nearly a line, and one without UV area."""
    squares = np.stack([rectangle((7 * k, 0, 0), (3, 0, 0), (0, 3, 0)) for k in range(3)])
    sizes = join_meshes(
        Scene(
            (quads(squares, [(0, 0, 1, 1), (0, 0, 1, 1e-6), (0, 0, 0, 0)], [0] * 3, 7, "Squares"),), (GREY,)
        )
    ).uv_sizes
    mean = np.sqrt(18 / (1 + 1e-6)) * 7
    assert sizes == pytest.approx(np.repeat([21, 4 * mean, mean], 2), rel=1e-4)


@pytest.mark.parametrize("count", [1, 255, 256, 1000])
def test_bounding_box_contains_the_extreme_corner_anywhere(count):
    for place in {0, count // 2, count - 1}:
        points = np.random.default_rng(count).uniform(-1, 1, (count, 3)).astype(np.float32)
        points[place] = -2, 3, 4
        expected = [points.min(axis=0), points.max(axis=0)]
        assert np.array_equal(bounding_box(points), expected)
