"""Progressive shooting and instant radiosity find the light that the full matrix gives."""

import numpy as np
import pytest

from engine import Scene
from engine.settings import Settings
from engine.visibility.views.hemicube import face_axes, frames
from engine.visibility.views.viewpoints import viewpoints
from tests.analytic.drive import prepare
from tests.analytic.scenes import furnace, light_room, material, quads, rectangle, room_walls
from tests.reference.cpu_hemicubes import texel_directions
from tests.reference.form_factors import form_factors
from tests.reference.gauss_seidel import gather, gauss_seidel
from tests.reference.instant_radiosity import InstantRadiosity, radical_inverse
from tests.reference.shooting import Shooting, texels_of


def split_room():
    """A room of 9 x 8 x 7 texels, a wall in its middle that hides a part, a light in one corner's wall."""
    walls = room_walls(0.9, 0.8, 0.7)
    panel = rectangle((0.5, 0.2, 0), (0, 0.5, 0), (0, 0, 0.4))
    sizes = [(9, 8), (9, 8), (8, 7), (8, 7), (9, 7), (9, 7), (5, 4)]
    charts, x = [], 0
    for width, height in sizes:
        charts.append((x, 0, width, height))
        x += width + 2
    mesh = quads(np.stack([*walls, panel]), charts, [0, 0, 1, 2, 0, 0, 0], 71, "Room")
    materials = (material("Grey", 0.6), material("Light", (0.3, 0.4, 0.2), (3, 2, 1)), material("Dark", 0.05))
    return Scene((mesh,), materials)


def shooting(prepared, hemicube):
    settings = Settings(resolution=prepared.patches.resolution, hemicube=hemicube)
    hemicubes = prepared.hemicubes(settings)
    seen = np.stack([hemicubes.view(patch).patch.ravel() for patch in range(len(prepared.patches))])
    points = viewpoints(prepared.triangles, prepared.geometry, settings)
    light = (prepared.emission, prepared.reflectance)
    return Shooting(prepared.geometry, seen, points, prepared.face, *light)


def truth(prepared):
    factors = form_factors(prepared.geometry, prepared.scene)
    radiance, _ = gauss_seidel(factors, prepared.emission, prepared.reflectance)
    return gather(factors, radiance, prepared.emission)


@pytest.mark.parametrize("n", [2, 8, 14])
def test_texels_are_where_their_directions_point(n):
    normal = np.array([[0.36, -0.48, 0.8]])
    axes = face_axes(frames(normal, np.array([0.7])))[0]
    directions = np.concatenate([grid @ face for grid, face in zip(texel_directions(n), axes, strict=True)])
    assert (texels_of(directions * 3.7, axes, n) == np.arange(3 * n * n)).all()


@pytest.mark.long
def test_shooting_ends_where_gauss_seidel_does():
    prepared = prepare(split_room(), 71)
    method, known = shooting(prepared, 16), truth(prepared)
    before = method.unshot.sum()
    errors = []
    while method.unshot.sum() > 1e-3 * before:
        method.shoot()
        errors.append(np.abs(method.irradiance - known).mean() / known.mean())
    assert errors[-1] < 0.08 and errors[-1] < 0.1 * errors[0]


def test_shooting_in_a_furnace_loses_what_disks_do_not_see_of_their_neighbours():
    prepared = prepare(furnace(0.5, 1.0, side=6), 32)
    method = shooting(prepared, 16)
    assert method.ambient == pytest.approx([2.0] * 3)
    left = []
    for _ in range(2000):
        method.shoot()
        left.append(method.unshot.sum())
    assert left[-1] < 0.02 * left[0] and method.shots == 2000
    assert 1.84 < method.irradiance.mean() < 2.001


def test_radical_inverse_mirrors_digits():
    assert [radical_inverse(k, 2) for k in range(5)] == [0, 0.5, 0.25, 0.75, 0.125]
    assert radical_inverse(5, 3) == pytest.approx(2 / 3 + 1 / 9)


def virtual_lights(prepared, nearest, **replaced):
    """Instant radiosity of a scene."""
    faces = np.concatenate([mesh.face for mesh in prepared.scene.meshes])
    light = {
        name: np.stack([getattr(surface, name) for surface in prepared.scene.materials])
        for name in ("emission", "reflectance")
    } | replaced
    of_triangles = (light[name][prepared.triangles.material] for name in ("emission", "reflectance"))
    return InstantRadiosity(prepared.triangles, prepared.geometry, faces, *of_triangles, nearest)


@pytest.mark.long
def test_virtual_lights_sum_to_the_light_of_the_full_matrix():
    prepared = prepare(split_room(), 71)
    known = truth(prepared)
    steps = list(virtual_lights(prepared, 0.02).estimates(150))
    errors = [np.abs(light - known).mean() / known.mean() for _, light in steps]
    assert errors[-1] < 0.12 and errors[-1] < 0.3 * errors[0]
    lights, light = steps[-1]
    assert light.mean() == pytest.approx(known.mean(), rel=0.06) and lights > 200


def test_virtual_lights_of_black_walls_are_on_the_lights():
    prepared = prepare(light_room(), 64)
    black = np.full((len(prepared.scene.materials), 3), 1e-6)
    *_, (lights, light) = virtual_lights(prepared, 0.05, reflectance=black).estimates(40)
    factors = form_factors(prepared.geometry, prepared.scene)
    assert lights == 40
    assert light.mean() == pytest.approx(
        gather(factors, prepared.emission, prepared.emission).mean(), rel=0.1
    )
