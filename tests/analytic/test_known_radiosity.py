"""Bakes of scenes whose radiosity is known in closed form."""

import dataclasses

import numpy as np
import pytest

from engine import Light, Scene, Settings
from engine.scene.checks import LARGEST, SMALLEST
from tests.analytic import scenes
from tests.analytic.drive import Prepared, drive, drive_with_progress, irradiance, prepare
from tests.reference import analytic
from tests.rows import long

#: Relative rms error of E by hemicube width with random rotation, as simulated in double precision.
HEMICUBE_ERROR = {8: 0.124, 16: 0.050, 32: 0.020, 64: 0.0078, 128: 0.0035}

#: Faces of `scenes.light_room`: the first piece of the ceiling, and the light.
CEILING, LIGHT = 5, 13


@pytest.mark.parametrize("reflectance", [0.5, 0.9])
def test_furnace(reflectance):
    settings = Settings(resolution=32, hemicube=32, max_bounces=300, tolerance=5e-4)
    lightmap = drive(scenes.furnace(reflectance, 1.0), settings)
    expected = analytic.furnace_radiance(1.0, reflectance)
    assert lightmap.report.converged
    assert irradiance(lightmap) == pytest.approx(np.full((384, 3), expected), rel=0.005)


def test_furnace_loses_no_light_where_rays_meet_the_borders_of_charts():
    settings = Settings(resolution=32, hemicube=32, max_bounces=30, tolerance=5e-4, rotate=False)
    lightmap = drive(scenes.furnace(0.5, 1.0), settings)
    assert irradiance(lightmap) == pytest.approx(np.full((384, 3), 2.0), rel=0.005)


@pytest.mark.parametrize("settings", [{"visibility": "rays"}, {"visibility": "raster"}, {"method": "paper"}])
def test_walls_thinner_on_the_lightmap_than_a_texel_let_no_light_in(settings):
    """Their patches stand within the walls: on an edge, where two walls meet, half of the sky is seen."""
    charts = [(2.53 + 4 * wall + 0.01 * wall, 3.3 + 0.1 * wall, 0.4, 11.37) for wall in range(5)]
    room = scenes.quads(scenes.room_walls(0.7, 1.3, 1.1), [*charts, (23, 3, 5, 9)], [0] * 6, 29, "Room")
    scene = Scene((room,), (scenes.material("Grey", 0.5),), world=np.ones(3, np.float32))
    lightmap = drive(scene, Settings(resolution=29, max_bounces=3, **settings))
    assert lightmap.has_patch.sum() > 30
    assert irradiance(lightmap).max() < 0.01


@pytest.mark.parametrize("distance", [100, 1000])
def test_furnace_away_from_the_origin(distance):
    scene = scenes.furnace(0.5, 1.0)
    positions = scene.meshes[0].positions + np.float32([distance, -distance, 0])
    moved = dataclasses.replace(scene, meshes=(dataclasses.replace(scene.meshes[0], positions=positions),))
    lightmap = drive(moved, Settings(resolution=32, hemicube=16, max_bounces=30, tolerance=1e-4))
    assert irradiance(lightmap) == pytest.approx(np.full((384, 3), 2.0), rel=0.005)


@pytest.mark.parametrize("distance", [1e6, 1e8])
def test_furnace_beside_something_far_away(distance):
    """By rays: the room's corners are the median ones, and keep their digits."""
    scene = scenes.furnace(0.5, 1.0)
    far = scenes.rectangle((distance, -distance, distance), (distance / 7, 0, 0), (0, distance / 5, 0))
    square = scenes.quads(far[None], [(1, 23, 7, 5)], [0], 32, "Far")
    scene = dataclasses.replace(scene, meshes=(square, *scene.meshes))
    lightmap = drive(scene, Settings(resolution=32, visibility="rays", max_bounces=30, tolerance=1e-4))
    room = lightmap.has_patch[0, :23]
    assert room.sum() == 384
    assert lightmap.image[0, :23][room] == pytest.approx(np.full((384, 3), 2.0), rel=0.005)


@pytest.mark.parametrize("size", [LARGEST, SMALLEST])
@pytest.mark.parametrize("settings", [{"visibility": "rays"}, {"visibility": "raster"}, {"method": "paper"}])
def test_furnaces_of_the_largest_and_the_smallest_size(size, settings):
    scene = scenes.furnace(0.5, 1.0)
    positions = scene.meshes[0].positions * np.float32(size)
    sized = dataclasses.replace(scene, meshes=(dataclasses.replace(scene.meshes[0], positions=positions),))
    lightmap = drive(sized, Settings(resolution=32, hemicube=16, max_bounces=30, tolerance=1e-3, **settings))
    assert irradiance(lightmap) == pytest.approx(np.full((384, 3), 2.0), rel=0.005)


@pytest.mark.parametrize("size", [LARGEST, 1.0, SMALLEST])
def test_lamps_in_rooms_of_the_largest_and_the_smallest_size(size):
    """A point in the middle and an area light under the ceiling; the light of the room of 1 m."""
    room = scenes.furnace(0.0, 0.0)
    positions = room.meshes[0].positions * np.float32(size)
    middle, high = np.full(3, size / 2), np.array([0.5, 0.5, 0.9]) * size
    lamps = (
        Light("Point", "point", middle, np.eye(3), np.full(3, np.float32(size) ** 2), radius=size / 100),
        Light("Area", "area", high, np.eye(3), np.ones(3, np.float32), size=np.full(2, size / 2)),
    )
    sized = dataclasses.replace(room.meshes[0], positions=positions)
    settings = Settings(resolution=32, hemicube=8, max_bounces=1, visibility="rays", light_samples=256)
    light = irradiance(drive(Scene((sized,), room.materials, lights=lamps), settings))
    patch = 1 / 8
    centre = 1 / np.pi * 0.5 / (0.25 + 2 * (patch / 2) ** 2) ** 1.5
    square = scenes.rectangle((0.25, 0.25, 0.9), (0, 0.5, 0), (0.5, 0, 0))
    lit = np.abs(
        analytic.polygon(np.array([[0.5 + patch / 2, 0.5 + patch / 2, 0]]), np.eye(3)[2:], square)
    ).max()
    assert light.max() == pytest.approx(centre + lit, rel=0.02)


def test_furnace_on_a_plain_of_ten_kilometres():
    scene = scenes.furnace(0.5, 1.0)
    plain = scenes.rectangle((-5000, -5000, -1), (10000, 0, 0), (0, 10000, 0))
    ground = scenes.quads(plain[None], [(2, 22, 8, 8)], [0], 32, "Plain")
    lightmap = drive(
        dataclasses.replace(scene, meshes=(*scene.meshes, ground)),
        Settings(resolution=32, hemicube=16, max_bounces=30, tolerance=1e-4),
    )
    inside = lightmap.image[0, :20][lightmap.has_patch[0, :20]]
    assert inside == pytest.approx(np.full((384, 3), 2.0), rel=0.005)


def test_a_smooth_convex_emitter_lights_nothing_of_itself():
    """A cube whose normals are those of a ball: they lean over its faces, yet no face sees itself."""
    scene = scenes.furnace(0.5, 1.0)
    mesh = scene.meshes[0]
    positions = np.ascontiguousarray(mesh.positions[:, ::-1])
    normals = positions - np.float32(0.5)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    cube = dataclasses.replace(mesh, positions=positions, normals=normals, uvs=mesh.uvs[:, ::-1].copy())
    lightmap = drive(
        dataclasses.replace(scene, meshes=(cube,)), Settings(resolution=32, hemicube=32, max_bounces=3)
    )
    assert np.abs(irradiance(lightmap)).max() == 0


@pytest.mark.parametrize("perpendicular", [False, True])
def test_form_factor_of_unit_squares(perpendicular):
    scene = scenes.facing_squares(perpendicular)
    lightmap = drive(scene, Settings(resolution=64, hemicube=64, max_bounces=1))
    floor = prepare(scene, 64).face == 0
    expected = 0.20004378 if perpendicular else 0.19982490
    assert irradiance(lightmap)[floor].mean() == pytest.approx(expected, rel=0.01)


def test_inside_of_a_sphere_of_arbitrary_colours():
    scene = scenes.sphere()
    prepared = prepare(scene, 64)
    lightmap = drive(scene, Settings(resolution=64, hemicube=32, max_bounces=100, tolerance=5e-4))
    area = prepared.geometry.area
    expected = analytic.sphere_irradiance(prepared.emission, prepared.reflectance, area)
    relative = irradiance(lightmap) / expected - 1
    assert np.sqrt(np.average(relative**2, axis=0, weights=area)).max() < 0.01
    assert np.abs(np.average(relative, axis=0, weights=area)).max() < 0.003


@pytest.mark.parametrize("hemicube", [8, long(16), long(32), long(64), long(128)])
def test_error_by_hemicube_width(hemicube):
    # Points on grids of 16 x 16 and 32 x 32 a wall: either alone is lucky at one width, unlucky at another.
    squares = [light_room_error(resolution, hemicube) for resolution in (64, 128)]
    assert np.sqrt(np.mean(squares)) <= HEMICUBE_ERROR[hemicube]


def test_energy_never_grows_by_more_than_the_greatest_reflectance():
    scene = scenes.sphere()
    prepared = prepare(scene, 64)
    for before, gathered in sweeps(
        prepared, Settings(resolution=64, hemicube=16, max_bounces=4, tolerance=0)
    ):
        reflected = prepared.geometry.area @ (prepared.reflectance * gathered)
        assert (reflected <= prepared.reflectance.max() * (prepared.geometry.area @ before)).all()


def test_a_closed_room_of_one_reflectance_loses_no_energy():
    scene = recoloured_box([0.6] * 6, [1, 0, 0, 2, 0, 0])
    prepared = prepare(scene, 32)
    for before, gathered in sweeps(
        prepared, Settings(resolution=32, hemicube=32, max_bounces=4, tolerance=0)
    ):
        received = prepared.geometry.area @ gathered
        assert received == pytest.approx(prepared.geometry.area @ before, rel=0.005)


def light_room_error(resolution: int, hemicube: int) -> float:
    """Return the mean square relative error of E in `scenes.light_room`, each wall counting alike."""
    prepared = prepare(scenes.light_room(), resolution)
    lightmap = drive(prepared.scene, Settings(resolution=resolution, hemicube=hemicube, max_bounces=1))
    relative = irradiance(lightmap)[:, 0] / light_room_irradiance(prepared) - 1
    face = prepared.face
    wall = np.where(face == LIGHT, -1, np.minimum(face, CEILING))
    return float(np.mean([(relative[wall == index] ** 2).mean() for index in range(6)]))


def light_room_irradiance(prepared: Prepared) -> np.ndarray:
    """Return E/pi of every patch of `scenes.light_room` by Lambert's formula, (n,) float64."""
    geometry, face = prepared.geometry, prepared.face
    positions = prepared.triangles.positions
    corners = np.concatenate([positions[0::2], positions[1::2, 2:]], axis=1)
    total = np.zeros(len(face))
    for index, quad in enumerate(corners):
        everywhere = np.repeat(quad[None], len(face), axis=0)
        factor = np.abs(analytic.polygon(geometry.center, geometry.normal, everywhere))
        total += np.where(face == index, 0, factor) * prepared.emission[face == index][0, 0]
    return total


def recoloured_box(reflectances: list[float], emissions: list[float]) -> Scene:
    """Return the box of the furnace with a material for each wall."""
    mesh = scenes.furnace(0, 0).meshes[0]
    pairs = enumerate(zip(reflectances, emissions, strict=True))
    materials = tuple(scenes.material(f"Wall {i}", rho, e) for i, (rho, e) in pairs)
    return Scene((dataclasses.replace(mesh, material=mesh.face),), materials)


def sweeps(prepared: Prepared, settings: Settings) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the radiance before and E/pi gathered by each iteration of a bake, (n, 3) float32 each."""
    _, steps = drive_with_progress(prepared.scene, dataclasses.replace(settings, accelerate=False))
    radiance, result = prepared.emission, []
    for progress in steps:
        if progress.intermediate is not None:
            gathered = progress.intermediate[0].reshape(-1, 3)[prepared.patches.texel]
            result.append((radiance, gathered))
            radiance = prepared.emission + prepared.reflectance * gathered
    assert len(result) == settings.max_bounces
    return result
