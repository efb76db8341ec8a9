"""Light of a sky map, and surfaces that let it through."""

import dataclasses

import numpy as np
import pytest

from engine import Material, Scene, Settings, Texture
from engine.scene.cutouts import EXTENSIONS, map_uvs
from engine.scene.texture import sample
from tests.analytic.drive import drive, irradiance
from tests.analytic.scenes import quads, rectangle
from tests.transparency import CLEAR_BACK, transparent

SETTINGS = Settings(resolution=16, hemicube=32, sample_emission=False)
BLACK = np.zeros(3, np.float32)

X, Y, Z = np.eye(3)


def opaque(**changes):
    return dataclasses.replace(Material("Black", BLACK, BLACK), **changes)


def sky(height, radiance):
    """Return an equirectangular map of a function of the direction, (h, 2h, 3) float32."""
    v = (np.arange(height) + 0.5) / height
    u = (np.arange(2 * height) + 0.5) / (2 * height)
    theta, phi = np.pi * (1 - v)[:, None], 2 * np.pi * (0.5 - u)[None]
    directions = np.stack(
        np.broadcast_arrays(np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)), axis=2
    )
    return np.repeat(radiance(directions)[..., None], 3, axis=2).astype(np.float32)


def lit(world, normal_from, material, above=None):
    """Return the mean E/pi of a 1 m square spanned by two edges, perhaps with a canopy around it."""
    floor = quads(rectangle((0, 0, 0), *normal_from)[None], [(1, 1, 6, 6)], [0], 16, "Square")
    meshes = (floor,)
    if above is not None:
        canopy = quads(above[None], [(9, 1, 6, 6)], [1], 16, "Canopy")
        meshes = (floor, dataclasses.replace(canopy, texture_uvs={"Map": canopy_uvs()}))
    lightmap = drive(Scene(meshes, (opaque(), material), world=world), SETTINGS)
    chosen = np.argwhere(lightmap.has_patch[0])[:, 1] < 8
    return irradiance(lightmap)[chosen].mean(axis=0)


def canopy_uvs():
    return np.float32([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]])


def canopy(height=0.05, size=200.0, up=False):
    """Return a large quad over the square that faces it, or away from it."""
    corner = np.array([-size / 2, -size / 2, height])
    edges = (size * X, size * Y) if up else (size * Y, size * X)
    return rectangle(corner, *edges)


@pytest.mark.parametrize("edges", [(X, Y), (Y, Z), (Z, Y), (Z, X)])
def test_a_linear_sky_lights_by_its_slope(edges):
    """Radiance a + b . direction gives E/pi = a + 2/3 b . normal, whatever the normal."""
    slope = np.array([0.3, -0.2, 0.4])
    world = sky(64, lambda direction: 1 + direction @ slope)
    expected = 1 + 2 / 3 * slope @ np.cross(*edges)
    assert lit(world, edges, opaque()) == pytest.approx(np.full(3, expected), rel=2e-3)


@pytest.mark.parametrize("method", ["cached", "stream"])
@pytest.mark.parametrize("groups", [1, 2])
def test_few_rays_know_a_sky_that_nothing_hides(method, groups):
    """Samples estimate the visible fraction of the sky; without occlusion it is exactly 1, without noise."""
    slope = np.array([0.3, -0.2, 0.8])
    world = sky(64, lambda direction: 1 + direction @ slope)
    scene = Scene((tilted_square(),), (opaque(),), world=world)
    few = Settings(resolution=16, visibility="rays", samples=16, method=method, patch_groups=groups)
    expected = 1 + 2 / 3 * slope @ TILTED
    assert irradiance(drive(scene, few)) == pytest.approx(expected, rel=2e-3)


def test_a_wall_that_hides_half_of_an_uneven_sky_hides_its_light():
    """And not the mean of the sky: light comes from the other side alone."""
    world = sky(64, lambda direction: np.where(direction[..., 0] > 0, 1.5, 0.5))
    wall = quads(rectangle((-1e-3, -500, 0), 1000 * Y, 1000 * Z)[None], [(9, 1, 6, 6)], [0], 16, "Wall")
    floor = quads(rectangle((0, 0, 0), 1e-2 * X, 1e-2 * Y)[None], [(1, 1, 6, 6)], [0], 16, "Floor")
    few = Settings(resolution=16, visibility="rays", samples=16)
    lights = [
        drive(Scene((floor, wall), (opaque(),), world=world), dataclasses.replace(few, seed=seed))
        for seed in range(4)
    ]
    light = np.mean([lightmap.image[0, 1:7, 1:7] for lightmap in lights])
    assert light == pytest.approx(0.75, rel=0.02)


def test_a_bright_spot_that_few_rays_miss_is_not_added_where_it_is_hidden():
    """Such a sky is left as its samples have it, where bright light is not sampled as a light."""
    world = np.full((32, 64, 3), 0.1, np.float32)
    world[20, 5] = 1000
    few = Settings(resolution=16, visibility="rays", samples=16, sample_emission=False)
    image = drive(Scene((tilted_square(),), (opaque(),), world=world), few).image[0, 1:7, 1:7]
    assert np.median(image) == pytest.approx(0.1, rel=1e-3)


#: A normal that is no axis.
TILTED = np.array([0.48, -0.36, 0.8])


def tilted_square():
    along = np.cross(TILTED, X) / np.linalg.norm(np.cross(TILTED, X))
    return quads(
        rectangle((0, 0, 0), along, np.cross(TILTED, along))[None], [(1, 1, 6, 6)], [0], 16, "Square"
    )


def test_without_holes_a_canopy_keeps_all_light_out():
    assert lit(np.ones(3, np.float32), (X, Y), opaque(), canopy()) == pytest.approx(np.zeros(3), abs=2e-3)


def test_half_transparent_surfaces_let_half_the_light_through():
    through = lit(np.ones(3, np.float32), (X, Y), opaque(transmission=transparent(0.5)), canopy())
    assert through == pytest.approx(np.full(3, 0.5), rel=0.02)


@pytest.mark.parametrize("threshold", [None, 0.5])
def test_alpha_maps_cut_holes(threshold):
    """A wide canopy whose half with y > 0 is a hole, 5 cm above: light comes from that half only."""
    pixels = np.float32([1.0, 1.0, 0.0, 0.0]).reshape(4, 1, 1)
    texture = Texture("Holes", pixels, "Map", extension="extend", smooth=False)
    turned = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    mapped = dataclasses.replace(texture, transform=turned)
    material = opaque(transmission=transparent(1.0, mapped, threshold))
    world = np.ones(3, np.float32)
    through = lit(world, (X, Y), material, rectangle((-100, -99.5, 0.05), 200 * Y, 200 * X))
    assert through == pytest.approx(np.full(3, 0.5), abs=0.03)


#: Texture coordinates, near and so far away that no int32 counts their pixels.
UVS = np.float32(
    [
        (0.3, 0.65), (-0.3, 1.45), (2.25, -1.75), (70000.375, -70000.875), (1e8, 0.45), (0.1, -1e8),
        (-3e8, 3e8), (2147483648, 0.7), (-1e9, 1e9), (1e30, 0.25), (-np.inf, 0.9), (np.nan, 0.1),
    ]
)  # fmt: skip


@pytest.mark.parametrize("visibility", ["raster", "rays"])
@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("extension", EXTENSIONS)
def test_alpha_maps_go_on_beyond_their_borders(extension, smooth, visibility):
    """Canopies of one texture coordinate each, 40 m apart, with the pixels of engine/scene/texture.py."""
    pixels = np.random.default_rng(7).choice(np.float32([0, 0.25, 0.5, 0.75, 1]), (5, 7, 1))
    texture = Texture("Holes", pixels, "Map", extension=extension, smooth=smooth)
    meshes = []
    for index, uv in enumerate(UVS):
        floor, roof = rectangle((0, 0, 0), 0.01 * X, 0.01 * Y), canopy(0.01, 20.0)
        corners = np.stack([floor, roof]) + 40.0 * index * X
        charts = [(1 + 4 * index, 1, 2, 2), (1 + 4 * index, 5, 2, 2)]
        mesh = quads(corners, charts, [0, 1], 64, f"Canopy {index}")
        meshes.append(dataclasses.replace(mesh, texture_uvs={"Map": np.tile(uv, (4, 3, 1))}))
    scene = Scene(
        tuple(meshes),
        (opaque(), opaque(transmission=transparent(1.0, texture))),
        world=np.ones(3, np.float32),
    )
    settings = dataclasses.replace(SETTINGS, resolution=64, visibility=visibility, directions="hemicube")
    image = drive(scene, settings).image[0]
    through = [image[1:3, 1 + 4 * index : 3 + 4 * index].mean() for index in range(len(UVS))]
    expected = 1 - sample(pixels, map_uvs(texture, UVS), texture)[:, 0]
    assert np.array(through) == pytest.approx(expected, abs=0.06)


@pytest.mark.parametrize(("clear", "up", "expected"), [(True, True, 1), (True, False, 0), (False, True, 0)])
def test_clear_backs_are_see_through(clear, up, expected):
    material = opaque(transmission=CLEAR_BACK) if clear else opaque()
    light = lit(np.ones(3, np.float32), (X, Y), material, canopy(up=up))
    assert light == pytest.approx(np.full(3, float(expected)), abs=2e-3)
