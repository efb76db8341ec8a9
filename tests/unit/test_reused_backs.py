"""Places of back faces that successive bakes of one geometry share."""

from dataclasses import replace

import numpy as np

from engine import Scene
from engine.patches.backs import with_places
from engine.scene.memo import Memo
from tests.analytic.scenes import material, quads, rectangle

_WIDTH = 31


def _scene(reflectance: float, height: float = 0.5) -> Scene:
    """Return two open sheets of different materials."""
    corners = np.stack([rectangle((0, 0, at), (1, 0, 0), (0, 1, 0)) for at in (0.0, height)])
    mesh = quads(corners, [(1, 1, 13, 13), (16, 1, 13, 13)], [0, 1], _WIDTH)
    return Scene((mesh,), (material("Floor", 0.5), material("Card", reflectance)))


def test_a_change_of_materials_keeps_the_meshes_and_shows_the_new_materials() -> None:
    last = Memo[Scene]()
    first = with_places(_scene(0.2), _WIDTH, last=last)
    again = with_places(_scene(0.8), _WIDTH, last=last)
    fresh = with_places(_scene(0.8), _WIDTH)
    assert len(first.meshes) > 1 and again.meshes is first.meshes
    assert again.atlases == fresh.atlases
    for one, other in zip(again.materials, fresh.materials, strict=True):
        assert np.array_equal(one.reflectance, other.reflectance)


def test_moved_or_translucent_surfaces_are_placed_again() -> None:
    last, still = Memo[Scene](), _scene(0.2)
    first = with_places(still, _WIDTH, last=last)
    cloth = replace(still.materials[1], translucency=np.full(3, 0.4, np.float32))
    for changed in (_scene(0.2, 0.25), replace(still, materials=(still.materials[0], cloth))):
        again, fresh = with_places(changed, _WIDTH, last=last), with_places(changed, _WIDTH)
        assert again.meshes is not first.meshes and len(again.meshes) == len(fresh.meshes)
        for one, other in zip(again.meshes, fresh.meshes, strict=True):
            assert np.array_equal(one.positions, other.positions) and np.array_equal(one.uvs, other.uvs)
