"""Energy balance: emitted = absorbed + escaped + not bounced, and known values of each term."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.rooms import cornell_box
from engine import Light, Settings
from tests.analytic import scenes
from tests.analytic.drive import drive
from tests.analytic.rooms import Atlas, block, lamp, room, scene_of
from tests.rows import long


def flux(scene):
    """Return the flux that the front faces of all surfaces emit, W, mean of the channels."""
    total = 0.0
    for mesh in scene.meshes:
        edges = mesh.positions[:, 1:] - mesh.positions[:, :1]
        area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2
        emission = np.stack([material.emission for material in scene.materials])[mesh.material]
        total += np.pi * float((area[:, None] * emission).sum(axis=0).mean())
    return total


def energy(scene, **settings):
    """Return the energy of a bake."""
    chosen = Settings(**{"hemicube": 32, "max_bounces": 40, "tolerance": 1e-4, **settings})
    return drive(scene, chosen).report.energy


def lit_room():
    """Return a closed room with a block that floats in it, on 97 texels, and a lamp of 1.7 W/sr."""
    atlas = Atlas(167)
    meshes = [room(atlas, (0, 0, 0), (1.96, 1.64, 1.24), "Room")]
    meshes += [block(atlas, (0.5, 0.5, 0.3), (0.9, 0.7, 0.5), "Block")]
    return scene_of(meshes, [lamp((1.3, 1.0, 0.8), 1.7)], reflectance=0.6)


#: Closed scenes, the width of their lightmaps, and how often their emission is seen: a light that hangs in a
#: room shines to both sides.
CLOSED = {
    "furnace": (lambda: scenes.furnace(0.8, 0.7), 32, 1),
    "sphere": (scenes.sphere, 64, 1),
    "nine quads": (scenes.nine_quad_room, 128, 2),
}


@pytest.mark.parametrize("name", CLOSED)
def test_closed_scenes_absorb_all_that_is_emitted(name):
    make, resolution, sides = CLOSED[name]
    scene = make()
    known, found = sides * flux(scene), energy(scene, resolution=resolution)
    assert found.emitted == pytest.approx(known, rel=1e-3)
    assert found.absorbed + found.escaped + found.not_bounced == pytest.approx(found.emitted, rel=1e-3)
    assert abs(found.escaped) < 1e-3 * known and abs(found.not_bounced) < 1e-3 * known


def test_lamp_of_a_closed_room_is_absorbed():
    found = energy(lit_room(), resolution=167)
    assert found.emitted == pytest.approx(4 * np.pi * 1.7, rel=1e-3)
    assert found.absorbed == pytest.approx(found.emitted, rel=1e-3)


@pytest.mark.parametrize(
    ("way", "tolerance"),
    [
        ({"method": "stream"}, 1e-3),
        long({"visibility": "raster"}, 5e-3),
        long({"patch_groups": 2}, 1e-2),
        long({"accelerate": False}, 1e-3),
        long({"sample_emission": False}, 1e-3),
    ],
)
def test_balance_holds_however_light_is_gathered(way, tolerance):
    """Boxes stand on a floor of 18 texels, a lamp hangs a texel below the ceiling.

    Rays start all over texels. Hemicubes see from their centres: of what shines there most is seen too well.
    """
    found = energy(cornell_box(61), resolution=61, **{"visibility": "rays", **way})
    assert found.emitted == pytest.approx(2 * flux(cornell_box(61)), rel=4e-3)
    assert abs(found.missing) < tolerance and abs(found.escaped) < 1e-3 * found.emitted


@pytest.mark.long
@pytest.mark.parametrize("width", [31, 127])
def test_hardly_any_light_is_missing_at_any_size_of_texels(width):
    assert abs(energy(cornell_box(width), resolution=width).missing) < 5e-4


@pytest.mark.long
@pytest.mark.parametrize("width", [160, 256])
def test_squares_of_adaptive_bakes_lose_little(width):
    """Groups gather at their representative patches; used on CPUs only."""
    found = energy(cornell_box(width), resolution=width, samples=256, adaptive=True, tolerance=5e-3)
    assert abs(found.missing) < 4e-3


def test_light_that_is_not_gathered_yet_is_the_residual():
    """After k bounces of a furnace, rho^k of the light is on its way."""
    for iterations in (1, 2, 3):
        found = energy(
            scenes.furnace(0.8, 0.7), resolution=32, max_bounces=iterations, tolerance=0, accelerate=False
        )
        assert found.not_bounced / found.emitted == pytest.approx(0.8**iterations, rel=1e-3)
        assert abs(found.missing) < 1e-3


def test_light_that_meets_nothing_escapes():
    """Two black squares: what the lower one does not get leaves. Light of unseen backs does not count."""
    scene = scenes.facing_squares(perpendicular=False, side=16)
    found = energy(scene, resolution=64)
    arriving = 0.19982490 * np.pi
    assert found.emitted == pytest.approx(np.pi, rel=2e-3)
    assert found.absorbed == pytest.approx(arriving, rel=5e-3)
    assert found.escaped == pytest.approx(np.pi - arriving, rel=2e-3)


def test_backs_absorb_what_fronts_send_them():
    """The back face of the upper square faces the lower square, which emits."""
    scene = scenes.facing_squares(perpendicular=False, side=16)
    mesh = scene.meshes[0]
    turned = mesh.positions.copy()
    turned[2:] = turned[2:, ::-1]
    mesh = replace(
        mesh, positions=turned, normals=mesh.normals * np.where(mesh.face, -1, 1)[:, None, None],
        uvs=np.concatenate([mesh.uvs[:2], mesh.uvs[2:, ::-1]]), material=1 - mesh.material,
    )  # fmt: skip
    found = energy(replace(scene, meshes=(mesh,)), resolution=64)
    assert found.absorbed == pytest.approx(0.19982490 * np.pi, rel=5e-3)
    assert found.absorbed + found.escaped == pytest.approx(np.pi, rel=2e-3)


def test_darkness_has_no_energy_and_the_paper_does_not_know_it():
    dark = energy(scenes.furnace(0.5, 0.0), resolution=32)
    assert dark.emitted == dark.absorbed == dark.missing == 0
    assert energy(scenes.furnace(0.5, 1.0), resolution=32, method="paper", max_bounces=2) is None


def test_sun_counts_where_it_arrives():
    """A sun of 2 W/m^2 on a floor of 1 m^2 that reflects a quarter of it into an open sky."""
    sun = Light("Sun", "sun", np.zeros(3), np.eye(3), np.full(3, 2.0, np.float32), half_angle=1e-4)
    atlas = Atlas(29)
    floor = scenes.rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0))[None]
    mesh = scenes.quads(floor, atlas.charts(floor), [0], 29, "Floor")
    found = energy(scene_of([mesh], [sun], reflectance=0.25), resolution=29)
    assert found.emitted == pytest.approx(2, rel=1e-3)
    assert found.absorbed == pytest.approx(1.5, rel=1e-3) and found.escaped == pytest.approx(0.5, rel=1e-3)
