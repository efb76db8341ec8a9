"""Detection of triangles that moved between two states of a scene."""

from types import SimpleNamespace

import numpy as np
import pytest

from engine import Scene
from engine.patches.moved_triangles import moved_triangles
from engine.scene.cutouts import read_cutouts
from engine.scene.transmission import Transmission
from engine.scene.triangles import join_meshes
from tests.analytic.scenes import material, quads, rectangle
from tests.transparency import transparent

RESOLUTION = 13


def room(*shifts: float, origin: float = 0.0, transmission: Transmission | None = None) -> Scene:
    """Return a scene of squares, a mesh each, lifted by these; m."""
    paint = material("Grey", 0.5)
    object.__setattr__(paint, "transmission", transmission or Transmission())
    meshes = []
    for number, shift in enumerate(shifts):
        square = rectangle((2 * number + origin, origin, shift), (1, 0, 0), (0, 1, 0))
        meshes.append(quads(square[None], [(3 * number, 1, 2, 2)], [0], RESOLUTION, f"Square {number}"))
    return Scene(tuple(meshes), (paint,))


def parts(scene: Scene, before: SimpleNamespace | None = None, **changes: object) -> SimpleNamespace:
    """Return what a subdivision of a scene has that says what has moved."""
    triangles = join_meshes(scene, before.triangles if before else None)
    texel = np.arange(5, dtype=np.int32)
    patches = SimpleNamespace(resolution=RESOLUTION, texel=texel, atlas=np.zeros(5, np.int32))
    texel_to_patch = np.zeros((1, RESOLUTION, RESOLUTION), np.uint32)
    made = {"patches": patches, "texel_to_patch": texel_to_patch, "cutouts": read_cutouts(scene), **changes}
    return SimpleNamespace(triangles=triangles, **made)


def test_what_has_moved_is_found_as_it_was_and_as_it_is():
    before = parts(room(0, 0, 0))
    after = parts(room(0, 0.25, 0), before)
    moved = moved_triangles(before, after)
    assert moved.shape == (4, 3, 3)
    assert np.allclose(np.ptp(moved[..., 2]), 0.25)
    assert moved_triangles(before, before).shape == (0, 3, 3)


@pytest.mark.parametrize("origin", [0.0, 1e4])
def test_what_stays_keeps_its_bits_however_the_median_moves(origin):
    before = parts(room(0, 0, 0, origin=origin))
    after = parts(room(-1.3, 0, 0, origin=origin), before)
    assert np.array_equal(after.triangles.positions[2:], before.triangles.positions[2:])
    assert after.triangles.diagonal == before.triangles.diagonal


def test_a_scene_that_goes_far_away_gets_an_origin_of_its_own():
    before = parts(room(0, 0, 0))
    away = parts(room(0, 0, 0, origin=500.0), before)
    assert np.abs(away.triangles.positions).max() < 10
    assert moved_triangles(before, parts(room(90, 91, 92), before)) is None


def test_a_mesh_with_other_triangles_has_moved_as_a_whole():
    before, scene = parts(room(0, 0, 0)), room(0, 0, 0)
    half = scene.meshes[1].subset(np.array([True, False]))
    after = parts(Scene((scene.meshes[0], half, scene.meshes[2]), scene.materials), before)
    assert len(moved_triangles(before, after)) == 3


def test_who_looks_up_a_texel_that_shows_another_patch_counts_as_moved():
    before = parts(room(0, 0, 0))
    shown = before.texel_to_patch.copy()
    shown[0, 2, 4] = 4
    moved = moved_triangles(before, parts(room(0, 0, 0), before, texel_to_patch=shown))
    assert len(moved) == 4
    assert (moved[..., 0] + before.triangles.origin[0] >= 2).all()


def test_other_patches_and_other_transparency_are_looked_at_anew():
    before = parts(room(0, 0, 0))
    fewer = SimpleNamespace(resolution=RESOLUTION, texel=np.arange(4), atlas=np.zeros(4, np.int32))
    assert moved_triangles(before, parts(room(0, 0, 0), before, patches=fewer)) is None
    assert moved_triangles(before, parts(room(0, 0, 0, transmission=transparent(0.5)), before)) is None
