"""Closed bodies of glass: fronts reflect for both faces, open sheets stay as they are."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Material, Scene
from engine.patches.closed_glass import with_closed_glass
from engine.scene import open_surfaces
from engine.scene.open_surfaces import OpenSurfaces, open_triangles
from engine.scene.transmission import BACK, FRONT, Fresnel, Transmittance, angular_factor, body_transmittance
from tests.analytic.scenes import material, quads, rectangle, room_walls
from tests.transparency import uniform_transmission

GREY = np.full(3, 0.4, np.float32)


def glass(*passed, **fresnel):
    transmittance = Transmittance(np.float32(passed), fresnel=Fresnel(1.5, **fresnel))
    return Material("Glass", GREY, 0 * GREY, transmission=uniform_transmission(transmittance))


def bodies(*materials, wall=0):
    """Return a box of material `wall`, a closed room of all materials in turn, and a sheet of each.

    All are far from the origin.
    """
    places = [(1 + 3 * i, 1, 2, 2) for i in range(6)]
    box = quads(room_walls(1, 1, 1)[:, ::-1] + 900, places, [wall] * 6, 32)
    turns = [i % len(materials) for i in range(6)]
    room = quads(room_walls(1, 1, 1) + 910, places, turns, 32)
    sheets = np.stack(
        [rectangle((900 + 3 * i, 905, 901), (1, 0, 0), (0, 1, 0)) for i in range(len(materials))]
    )
    sheet = quads(sheets, [(1 + 3 * i, 9, 2, 2) for i in range(len(materials))], range(len(materials)), 32)
    return Scene((box, room, sheet), materials)


def test_only_bodies_of_glass_get_another_material():
    """Neither a sheet nor panes in a closed room of walls are bodies."""
    scene = bodies(material("Wall", 0.5), glass(0.9, 0.9, 0.81), wall=1)
    found = with_closed_glass(scene)
    assert set(found.meshes[0].material) == {2} and found.meshes[1:] == scene.meshes[1:]
    assert found.materials[:2] == scene.materials
    sides = found.materials[2].transmission
    assert (sides.bounce.fresnel.body, sides.shadow_back.fresnel.body) == (FRONT, BACK)
    assert (found.materials[2].reflectance > 1.3 * GREY).all()


def test_bodies_are_searched_again_only_where_glass_moves(monkeypatch):
    searched = []

    def search(meshes):
        searched.append([len(mesh.positions) for mesh in meshes])
        return open_triangles(meshes)

    monkeypatch.setattr(open_surfaces, "open_triangles", search)
    scene, surfaces = bodies(material("Wall", 0.5), glass(0.9, 0.9, 0.9), wall=1), OpenSurfaces()
    sheet, extra = scene.meshes[2], replace(scene.meshes[1], material=0 * scene.meshes[1].material)
    scene = replace(scene, meshes=(extra, *scene.meshes))
    first = with_closed_glass(scene, surfaces)
    moved = replace(scene, meshes=(replace(extra, positions=extra.positions + 1), *scene.meshes[1:]))
    again = with_closed_glass(moved, surfaces)
    assert len(searched) == 1 and len(searched[0]) == 3
    assert again.meshes[0] is moved.meshes[0] and (again.meshes[1].material == 2).all()
    assert (first.meshes[1].material == 2).all()
    opened = replace(scene.meshes[1], positions=scene.meshes[1].positions.copy())
    opened.positions[:2] += 5
    assert with_closed_glass(replace(scene, meshes=(opened, sheet)), surfaces).meshes == (opened, sheet)


def test_both_faces_of_white_glass_reflect_what_they_do_not_transmit():
    """All light but what is reflected more than once inside."""
    surface = replace(glass(0.96, 0.96, 0.96), reflectance=np.ones(3, np.float32))
    factor = float(with_closed_glass(bodies(surface)).materials[1].reflectance[0])
    cosines = np.sqrt((np.arange(1000) + 0.5) / 1000)
    passed = 0.96 * angular_factor(Fresnel(1.5), cosines)
    front, back = (body_transmittance(passed, body) for body in (FRONT, BACK))
    assert front * back == pytest.approx(passed**2)
    assert 0.975 < (passed**2 + factor * (1 - front)).mean() < 1


def test_glass_without_triangles_changes_no_mesh():
    scene = bodies(material("Wall", 0.5))
    scene = replace(scene, materials=(*scene.materials, glass(0.9, 0.9, 0.9)))
    assert with_closed_glass(scene).meshes == scene.meshes


def test_scenes_without_plain_glass_stay_the_same():
    uneven, tinted = replace(glass(0.9, 0.9, 0.9), translucency=GREY), glass(0.9, 0.9, 0.6)
    for scene in (bodies(material("Wall", 0.5)), bodies(uneven), bodies(tinted), Scene((), ())):
        assert with_closed_glass(scene) is scene
