"""Directional maps against light whose effect on tilted normals is known."""

import dataclasses

import numpy as np
import pytest

from engine import Light, Scene, Settings, SettingsError
from engine.outputs import PROJECTED_MAPS
from engine.settings import check_settings
from tests.analytic.drive import drive
from tests.analytic.scenes import material, nine_quad_room, quads, rectangle
from tests.analytic.test_sky_and_cutouts import sky
from tests.analytic.tilts import directions, fitted, received, rough_normals
from tests.rows import long

X, Y, Z = np.eye(3)
NIGHT = np.zeros(3, np.float32)
SETTINGS = Settings(
    resolution=16, hemicube=64, samples=4096, light_samples=256, visibility="rays", hide_seams=False,
    outputs=("combined", "directional", "dominant_direction"),
)  # fmt: skip
WAYS = {
    "rays": {},
    "hemicube rays": {"directions": "hemicube"},
    "raster": {"visibility": "raster"},
    "streamed rays": {"method": "stream"},
    "streamed raster": {"method": "stream", "visibility": "raster"},
}

#: The same for tests: those that start rays from patches and keep what they see stand for all.
EVERY_WAY = [long(way) if way.startswith("streamed") or way == "raster" else way for way in WAYS]


def maps(scene, **changes):
    """Return E/pi, L0 and L1, axis after axis, mean over all patches, (3,), (3,), (3, 3)."""
    lightmap = drive(scene, dataclasses.replace(SETTINGS, **changes))
    shown = {name: image[lightmap.has_patch].mean(axis=0) for name, image in lightmap.passes.items()}
    l1 = np.stack([shown[f"L1 {axis}"] for axis in "xyz"])
    return shown["combined"], shown["L0"], l1, shown["dominant_direction"]


def projected(scene, **changes):
    """Return SH L0 and SH L1, axis after axis, mean over all patches, (3,), (3, 3)."""
    settings = dataclasses.replace(SETTINGS, outputs=("combined", "spherical_harmonics"), **changes)
    lightmap = drive(scene, settings)
    means = {name: image[lightmap.has_patch].mean(axis=0) for name, image in lightmap.passes.items()}
    assert list(means) == ["combined", *PROJECTED_MAPS]
    return means["SH L0"], np.stack([means[f"SH L1 {axis}"] for axis in "xyz"])


def square(edges=(X, Y), reflectance=0.0, size=0.02):
    """Return a small square at the origin."""
    corners = rectangle((0, 0, 0), size * edges[0], size * edges[1])
    return quads(corners[None], [(1, 1, 6, 6)], [0], 16, "Square")


def scene_of(mesh, lights=(), world=NIGHT):
    return Scene((mesh,), (material("Black", 0.0),), lights=tuple(lights), world=world)


def sun_from(direction, strength=(5.0, 3, 1)):
    """Return a sun in a direction; a surface that faces it has the irradiance E = strength."""
    z = np.asarray(direction) / np.linalg.norm(direction)
    x = np.cross(z, [0.3, 0.5, 0.8])
    x /= np.linalg.norm(x)
    return Light(
        "Sun", "sun", np.zeros(3), np.stack([x, np.cross(z, x), z]), np.float32(strength), half_angle=0.0
    )


@pytest.mark.parametrize("way", EVERY_WAY)
def test_a_uniform_sky_lights_by_how_much_of_it_a_normal_sees(way):
    """L1 points along the normal; its length is that of the fit, whichever way samples go."""
    light = directions(5000)
    expected = 2 * (fitted(light, 3000)).mean(axis=0)[2]
    combined, l0, l1, dominant = maps(scene_of(square((Y, Z)), world=np.float32([1, 2, 3])), **WAYS[way])
    assert combined == pytest.approx([1, 2, 3], rel=1e-3)
    assert l1[0] == pytest.approx(expected * np.array([1, 2, 3]), rel=0.015)
    assert l1[1:] == pytest.approx(np.zeros((2, 3)), abs=0.01)
    assert l0 + l1[0] == pytest.approx(combined, rel=1e-3)
    assert dominant == pytest.approx([expected, 0, 0], abs=0.01)


@pytest.mark.parametrize("angle", [0, 25, 50])
@pytest.mark.parametrize("edges", [(X, Y), (Z, Y), (Y, X), (X + Y, Z)])
def test_a_sun_lights_tilted_normals_by_their_cosine(edges, angle):
    """Of normals that it shines on from above; the dominant direction is its own, to 7 degrees at 50."""
    normal = np.cross(*edges) / np.linalg.norm(np.cross(*edges))
    across = edges[0] / np.linalg.norm(edges[0])
    towards = np.cos(np.radians(angle)) * normal + np.sin(np.radians(angle)) * across
    strength = np.array([5.0, 3, 1])
    _, l0, l1, dominant = maps(scene_of(square(edges), [sun_from(towards, strength)]))
    for tilt in (-0.1, 0.0, 0.3):
        tilted = np.cos(tilt) * normal + np.sin(tilt) * across
        assert l0 + tilted @ l1 == pytest.approx(strength / np.pi * (tilted @ towards), rel=0.03)
    assert dominant @ towards > 0.99 * np.linalg.norm(dominant)


@pytest.mark.parametrize("way", EVERY_WAY)
def test_spherical_harmonics_are_the_means_of_radiance_and_of_its_direction(way):
    """Over the whole sphere, of which half a sky of three colours lights the square from one side."""
    radiance = np.array([1.0, 2, 3])
    world = sky(64, lambda direction: np.where(direction @ (X + 0.5 * Y) > 0, 1.0, 0.1))
    l0, l1 = projected(scene_of(square((Y, Z)), world=world * radiance), **WAYS[way])
    light = directions(40000)[:, [2, 0, 1]]
    seen = np.where(light @ (X + 0.5 * Y) > 0, 1.0, 0.1)
    assert l0 == pytest.approx(0.5 * seen.mean() * radiance, rel=0.015)
    expected = (light * seen[:, None]).mean(axis=0) / seen.mean()
    assert l1 == pytest.approx(np.tile(expected[:, None], 3), abs=0.01)


@pytest.mark.parametrize("angle", [0, 40, 80])
def test_spherical_harmonics_of_a_sun_point_at_it(angle):
    """SH L1 has length 1, SH L0 a quarter of the sun's E/pi across its rays."""
    towards = np.cos(np.radians(angle)) * Z + np.sin(np.radians(angle)) * X
    strength = np.array([5.0, 3, 1])
    l0, l1 = projected(scene_of(square(), [sun_from(towards, strength)]))
    assert l0 == pytest.approx(strength / (4 * np.pi), rel=1e-3)
    assert l1 == pytest.approx(np.tile(towards[:, None], 3), abs=2e-3)


def test_spherical_harmonics_are_told_apart_from_the_fit():
    outputs = ("combined", "dominant_direction", "spherical_harmonics")
    with pytest.raises(SettingsError, match="Remove one of both"):
        check_settings(dataclasses.replace(SETTINGS, outputs=outputs))


@pytest.mark.parametrize("lamp", ["area", "point", "spot"])
def test_lamps_of_every_kind_have_the_direction_of_their_light(lamp):
    """An area light's light is computed, its direction sampled: 0.4 m wide, 3 m off."""
    where = np.array([1.0, -2, 2])
    z = where / 3
    x = np.cross(z, Y) / np.linalg.norm(np.cross(z, Y))
    size = {"size": np.full(2, 0.4)} if lamp == "area" else {"half_angle": 0.5} if lamp == "spot" else {}
    light = Light("Lamp", lamp, where, np.stack([x, np.cross(z, x), z]), np.ones(3, np.float32), **size)
    combined, _, l1, _ = maps(scene_of(square(), [light]))
    expected = combined[0] * fitted(z[None])[0] / z[2]
    assert l1[:, 0] == pytest.approx(expected, rel=0.02, abs=0.01 * float(combined[0]))


def test_an_emissive_wall_and_one_in_its_light_count():
    """Half of the sky is a shining wall of the scene: its direction comes by the rows of kept samples."""
    wall = rectangle((0.5, -50, 0), 100 * Z, 100 * Y)
    mesh = quads(np.stack([rectangle((0, -0.01, 0), 0.02 * X, 0.02 * Y), wall]), [(1, 1, 4, 4), (7, 1, 4, 4)],
                 [0, 1], 16, "Floor and wall")  # fmt: skip
    scene = Scene((mesh,), (material("Black", 0.0), material("Wall", 0.0, (1.0, 2, 4))))
    lightmap = {}
    for way in ("rays", "raster", "streamed rays"):
        settings = dataclasses.replace(SETTINGS, sample_emission=False, **WAYS[way])
        passes = drive(scene, settings).passes
        lightmap[way] = np.stack([passes[f"L1 {axis}"][0, 1:5, 1:5].mean(axis=(0, 1)) for axis in "xyz"])
    light = directions(20000)
    light = light[light[:, 0] > 0]
    expected = 2 * fitted(light, 3000).sum(axis=0) / 20000
    for l1 in lightmap.values():
        assert l1[:, 0] == pytest.approx(expected, abs=0.015)
        assert l1 == pytest.approx(l1[:, :1] * np.array([1.0, 2, 4]), rel=1e-3, abs=1e-4)


def test_bright_sky_and_dim_sky_give_one_sum():
    """Whether shadow rays or views find it."""
    world = sky(32, lambda direction: np.where(direction @ (X + Z) > 1.38, 200.0, 0.5))
    sampled, seen = (
        maps(scene_of(square(), world=world), sample_emission=sample, samples=16384)[2]
        for sample in (True, False)
    )
    assert sampled == pytest.approx(seen, rel=0.04, abs=0.02 * float(np.abs(seen).max()))


@pytest.mark.parametrize("way", EVERY_WAY)
def test_ways_agree_on_a_room_with_bounces(way):
    changes = {
        "resolution": 128,
        "hemicube": 16,
        "samples": 512,
        "sample_emission": False,
        "max_bounces": 2,
    }
    truth = drive(nine_quad_room(), dataclasses.replace(SETTINGS, **changes))
    other = drive(nine_quad_room(), dataclasses.replace(SETTINGS, **changes, **WAYS[way], seed=1))
    scale = truth.passes["combined"][truth.has_patch].mean()
    for name in ("L1 x", "L1 y", "L1 z"):
        difference = np.abs(truth.passes[name] - other.passes[name])[truth.has_patch].mean()
        assert difference < 0.08 * scale, (name, difference / scale)


@pytest.mark.long
def test_groups_and_texel_samples_bring_the_same_directions():
    changes = {"resolution": 128, "hemicube": 16, "samples": 512, "sample_emission": False}
    plain = drive(nine_quad_room(), dataclasses.replace(SETTINGS, **changes))
    for more in ({"patch_groups": 2}, {"texel_samples": 4}):
        other = drive(nine_quad_room(), dataclasses.replace(SETTINGS, **changes, **more))
        scale = plain.passes["combined"][plain.has_patch].mean()
        for name in ("L0", "L1 x", "L1 y", "L1 z"):
            difference = np.abs(plain.passes[name] - other.passes[name])[plain.has_patch]
            assert np.median(difference) < 0.05 * scale, (more, name)


def test_tilted_normals_of_a_rough_surface_are_near_the_truth():
    """Under half a sky, on average, to 5 %."""
    world = sky(64, lambda direction: np.where(direction @ (X + 0.3 * Z) > 0, 1.0, 0.1))
    _, l0, l1, _ = maps(scene_of(square(), world=world))
    light = directions(20000)
    radiance = np.where(light @ (X + 0.3 * Z) > 0, 1.0, 0.1)
    normals = rough_normals(997)
    truth = 2 * (received(normals, light) * radiance).mean(axis=1)
    assert np.abs(l0[0] + normals @ l1[:, 0] - truth).mean() < 0.05 * truth.mean()


def test_other_outputs_are_the_same_bits_beside_directional_maps():
    scene = dataclasses.replace(nine_quad_room(), lights=(sun_from((0.1, 0.2, 1)),))
    changes = {"resolution": 64, "hemicube": 8, "samples": 64, "hide_seams": True}
    plain, more = (
        drive(scene, dataclasses.replace(SETTINGS, **changes, outputs=outputs))
        for outputs in (("combined",), SETTINGS.outputs)
    )
    assert (plain.display == more.display).all()


def test_in_the_dark_directional_maps_are_black():
    lightmap = drive(scene_of(square()), SETTINGS)
    assert list(lightmap.passes) == ["combined", "L0", "L1 x", "L1 y", "L1 z", "dominant_direction"]
    assert not any(image.any() for image in lightmap.passes.values())


def test_directional_maps_go_with_combined_light_and_not_with_the_papers_method():
    with pytest.raises(SettingsError, match="Add combined"):
        check_settings(dataclasses.replace(SETTINGS, outputs=("directional",)))
    with pytest.raises(SettingsError, match="method is paper"):
        check_settings(dataclasses.replace(SETTINGS, method="paper"))
