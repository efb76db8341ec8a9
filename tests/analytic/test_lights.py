"""Light of every kind of lamp against closed forms, without and with shadow."""

import dataclasses

import numpy as np
import pytest

from engine import Light, Material, Scene, Settings, Texture
from engine.device import devices
from engine.scene.profile import Profile
from engine.scene.transmission import CLEAR, Transmission
from tests.analytic.drive import drive, drive_with_progress
from tests.analytic.scenes import quads, rectangle
from tests.no_compute import NoCompute
from tests.reference.analytic import polygon
from tests.transparency import transparent

BLACK = Material("Black", np.zeros(3, np.float32), np.zeros(3, np.float32))
DOWN = np.eye(3)
X, Y, Z = np.eye(3)
SETTINGS = Settings(resolution=16, hemicube=8, max_bounces=1, light_samples=256)


def light(kind, height=2.0, strength=5.0, **values):
    """Return a lamp over the origin that shines down."""
    where = np.array([0.0, 0.0, height])
    return Light("Lamp", kind, where, DOWN, np.full(3, strength, np.float32), **values)


def baked(lamp, size=0.02, *more, emitting=BLACK, settings=SETTINGS):
    """Return direct E/pi of a square at the origin that faces up, (6, 6), with more quads about."""
    floor = rectangle((-size / 2, -size / 2, 0), size * X, size * Y)
    mesh = quads(floor[None], [(1, 1, 6, 6)], [0], 16, "Floor")
    meshes = [mesh]
    for index, corners in enumerate(more):
        meshes.append(quads(corners[None], [(9, 1 + 3 * index, 2, 2)], [1], 16, f"Quad {index}"))
    lights = () if lamp is None else (lamp,)
    lightmap = drive(Scene(tuple(meshes), (BLACK, emitting), lights=lights), settings)
    return lightmap.image[0, 1:7, 1:7, 0]


def test_point():
    assert baked(light("point")) == pytest.approx(5 / (np.pi * 4), rel=1e-3)


def test_point_as_a_disk():
    assert baked(light("point", radius=0.5)) == pytest.approx(5 / (np.pi * (4 + 0.25)), rel=3e-3)


def test_point_as_a_sphere():
    assert baked(light("point", radius=0.5, soft=False)) == pytest.approx(5 / (np.pi * 4), rel=3e-3)


@pytest.mark.parametrize("kind", ["point", "spot"])
@pytest.mark.parametrize(("height", "aside"), [(0.5, 0.0), (-0.5, 0.3), (0.0, 0.0), (0.0, 0.98), (1e-4, 0.0)])
def test_inside_of_a_sphere_light_comes_from_everywhere(kind, height, aside):
    """Its radiance is I / (pi r^2), so E/pi is that whichever way a surface faces: 2.533 of 100 W, 1 m."""
    lamp = light(kind, height, strength=100 / (4 * np.pi), radius=1.0, soft=False, half_angle=0.5)
    lamp = dataclasses.replace(lamp, position=np.array([aside, 0, height]))
    assert baked(lamp) == pytest.approx(100 / (4 * np.pi**2), rel=1e-5)


def test_inside_of_a_sphere_light_others_count_as_much_as_outside():
    """Samples go to lamps by what each may bring: a sphere from within is no endless source."""
    inside = light("point", 1e-5, 0.01, radius=1.0, soft=False)
    lamps = (inside, dataclasses.replace(light("point"), position=np.array([1.0, 0, 2.0])))
    mesh = quads(rectangle((-0.01, -0.01, 0), 0.02 * X, 0.02 * Y)[None], [(1, 1, 6, 6)], [0], 16, "Floor")
    image = drive(Scene((mesh,), (BLACK,), lights=lamps), SETTINGS).image[0, 1:7, 1:7, 0]
    expected = 0.01 / np.pi + 5 / np.pi * 2 / 5**1.5
    assert image == pytest.approx(expected, rel=2e-2)


@pytest.mark.parametrize(("aside", "blend"), [(0.0, 0.5), (0.8, 0.5), (0.8, 0.15), (1.2, 1.0)])
def test_spot(aside, blend):
    lamp = light("spot", half_angle=np.radians(30), blend=blend)
    lamp = dataclasses.replace(lamp, position=np.array([aside, 0, 2.0]))
    d2, cosine = 4 + aside**2, 2 / np.sqrt(4 + aside**2)
    s = np.clip((cosine - np.cos(np.radians(30))) / ((1 - np.cos(np.radians(30))) * blend), 0, 1)
    expected = 5 * cosine / d2 / np.pi * s * s * (3 - 2 * s)
    assert baked(lamp).mean() == pytest.approx(expected, rel=1e-2, abs=1e-4)


@pytest.mark.parametrize("angle", [0.0, 0.1, 0.5])
def test_sun(angle):
    assert baked(light("sun", half_angle=angle)) == pytest.approx(5 / np.pi, rel=3e-3)


def test_slanted_sun():
    tilted = np.array([X, [0, np.cos(1), -np.sin(1)], [0, np.sin(1), np.cos(1)]])
    lamp = dataclasses.replace(light("sun", half_angle=0.05), axes=tilted)
    assert baked(lamp) == pytest.approx(5 / np.pi * np.cos(1), rel=3e-3)


def form_factor(width, depth, height):
    corners = rectangle((-width / 2, -depth / 2, height), depth * Y, width * X)
    return float(np.abs(polygon(np.zeros((1, 3)), Z[None], corners)).max())


@pytest.mark.parametrize("height", [3.0, 1.0, 0.1, 0.02])
def test_rectangle(height):
    lamp = light("area", height, size=np.array([1.0, 0.5]))
    image, expected = baked(lamp, 0.002), 5 * form_factor(1.0, 0.5, height)
    assert image.mean() == pytest.approx(expected, rel=3e-3)
    assert image == pytest.approx(expected, rel=2e-2)


def at(lamp, x, y):
    """Return a lamp elsewhere, at its height."""
    return dataclasses.replace(lamp, position=np.array([x, y, lamp.position[2]]))


@pytest.mark.parametrize(("place", "samples"), [((0.11, -0.1), 31), ((-0.13, 0.13), 17), ((0.15, -0.21), 53)])
def test_a_near_triangle_that_brings_little_is_no_noise(place, samples):
    """Of the two of a panel 5 cm away one brings less than one of so few rays stands for, but always."""
    lamp = at(light("area", 0.05, size=np.array([0.8, 0.6])), *place)
    corners = rectangle((place[0] - 0.4, place[1] - 0.3, 0.05), 0.6 * Y, 0.8 * X)
    halves = corners[[0, 1, 2]], corners[[0, 2, 3]]
    parts = [np.abs(polygon(np.zeros((1, 3)), Z[None], half)).max() for half in halves]
    assert 0.1 / samples < min(parts) / sum(parts) < 1 / samples
    settings = dataclasses.replace(SETTINGS, light_samples=samples)
    assert baked(lamp, 0.002, settings=settings) == pytest.approx(5 * sum(parts), rel=3e-3)


def test_samples_of_emitters_own_are_not_counted_twice():
    """Twelve panels in a row, some behind a wall: the mean is that of many rays."""
    lamps = tuple(at(light("area", 0.4, size=np.array([0.3, 0.3])), 0.35 * k, 0.1) for k in range(12))
    floor = rectangle((-0.01, -0.01, 0), 0.02 * X, 0.02 * Y)
    wall = rectangle((0.5, -1, 0.1), 2 * Y, 0.2 * Z)
    pieces = quads(np.stack([floor, wall]), [(1, 1, 6, 6), (9, 1, 2, 2)], [0, 0], 16, "Scene")
    scene = Scene((pieces,), (BLACK,), lights=lamps)
    choices = ({"light_samples": 512}, *({"light_samples": 2, "seed": seed} for seed in range(3)))
    bakes = (drive(scene, dataclasses.replace(SETTINGS, **values)) for values in choices)
    many, *few = (lightmap.image[0, 1:7, 1:7, 0] for lightmap in bakes)
    assert np.mean(few) == pytest.approx(many.mean(), rel=0.01)


@pytest.mark.parametrize("height", [3.0, 0.5, 0.05])
def test_disk(height):
    lamp = light("area", height, size=np.array([1.0, 1.0]), ellipse=True)
    assert baked(lamp, 0.002) == pytest.approx(5 * 0.25 / (0.25 + height**2), rel=1e-2)


def test_spread():
    """On the axis of a small light the radiance is tan a / (tan a - a) times that without spread."""
    half = np.radians(30)
    lamp = light("area", size=np.array([0.02, 0.02]), half_angle=half)
    expected = 5 * form_factor(0.02, 0.02, 2) * np.tan(half) / (np.tan(half) - half)
    assert baked(lamp) == pytest.approx(expected, rel=2e-2)


@pytest.mark.parametrize("compute", [devices.ComputeDevice, NoCompute])
def test_spread_below_a_degree_counts_as_a_degree(compute, monkeypatch):
    """A spread of 0 gave NaN, or no light."""
    monkeypatch.setattr(devices, "ComputeDevice", compute)
    least, *narrower = (
        baked(light("area", size=np.array([0.02, 0.02]), half_angle=np.radians(half)))
        for half in (0.5, 0.0, 0.001)
    )
    assert (least > 0).all() and all(np.array_equal(image, least) for image in narrower)


def test_dim_penumbra_of_a_spread():
    """A roof hides a light's cone except for its rim, in which few of 16 rays start."""
    half, edge = np.radians(10), 0.08
    lamp = light("area", size=np.ones(2), half_angle=half)
    roof = rectangle((-2, -2, 1), (2 + edge) * X, 4 * Y)
    few = [dataclasses.replace(SETTINGS, light_samples=16, seed=seed) for seed in range(20)]
    image = np.mean([baked(lamp, 0.002, roof, settings=each) for each in few])

    # The integral over the part of the light that the roof does not hide.
    x, y = np.meshgrid(*2 * [(np.arange(1000) + 0.5) / 1000 - 0.5])
    slope = np.hypot(x, y) / 2
    radiance = 5 * np.maximum(np.tan(half) - slope, 0) / (np.tan(half) - half) * (x > 2 * edge)
    expected = (radiance / (1 + slope**2) ** 2).mean() / (np.pi * 4)
    assert image == pytest.approx(expected, rel=0.06)


def test_area_lights_shine_on_one_side():
    lamp = dataclasses.replace(light("area", size=np.ones(2)), axes=np.array([X, -Y, -Z]))
    assert (baked(lamp) == 0).all()


@pytest.mark.parametrize("height", [1.0, 0.1])
def test_small_emissive_quads_are_sampled(height):
    """A quad that glows on both sides lights like an area light; hemicubes of 8 texels could not do it."""
    glow = dataclasses.replace(BLACK, emission=np.full(3, 5, np.float32))
    lamp = rectangle((-0.1, -0.1, height), 0.2 * X, 0.2 * Y)
    wall = rectangle((-3, -3, 5), 6 * Y, 6 * X)
    floor = rectangle((-0.001, -0.001, 0), 0.002 * X, 0.002 * Y)
    meshes = (
        quads(floor[None], [(1, 1, 6, 6)], [0], 16, "Floor"),
        quads(lamp[None], [(9, 1, 2, 2)], [1], 16, "Lamp"),
        quads(wall[None], [(9, 9, 5, 5)], [0], 16, "Wall"),
    )
    image = drive(Scene(meshes, (BLACK, glow)), SETTINGS).image[0]
    assert image[1:7, 1:7, 0] == pytest.approx(5 * form_factor(0.2, 0.2, height), rel=5e-3)


def test_shadows_are_black_unless_the_lamp_casts_none():
    roof = rectangle((-1, -1, 1), 2 * X, 2 * Y)
    assert (baked(light("point"), 0.02, roof) == 0).all()
    assert baked(light("point", casts_shadow=False), 0.02, roof) == pytest.approx(5 / (np.pi * 4), rel=1e-3)


def test_glass_halves_light():
    roof = rectangle((-1, -1, 1), 2 * X, 2 * Y)
    glass = dataclasses.replace(BLACK, transmission=transparent(0.5))
    assert baked(light("point"), 0.02, roof, emitting=glass) == pytest.approx(5 / (np.pi * 8), rel=5e-3)


def test_penumbra_of_a_sun():
    """A half plane 1 m above hides the half of the sun's disk over its edge."""
    roof = rectangle((0, -50, 1), 50 * X, 100 * Y)
    light_below = baked(light("sun", half_angle=0.2), 0.002, roof)
    assert light_below == pytest.approx(5 / np.pi / 2, rel=0.02)


def test_penumbrae_get_more_rays():
    """16 rays leave 6.7 % of noise where half of a sun is hidden; there they go on."""
    roof = rectangle((0, -50, 1), 50 * X, 100 * Y)
    few = [dataclasses.replace(SETTINGS, light_samples=16, seed=seed) for seed in range(5)]
    texels = np.array([baked(light("sun", half_angle=0.2), 0.002, roof, settings=each) for each in few])
    assert texels.std() < 0.035 * 5 / np.pi
    assert texels.mean() == pytest.approx(5 / np.pi / 2, rel=0.01)


def test_edges_of_shadows_are_averaged_over_texels():
    """The edge of a sharp shadow runs through the middle of the fourth column of six."""
    edge = -0.03 + 3.5 / 6 * 0.06
    roof = rectangle((edge, -1, 0.5), 2 * X, 2 * Y)
    image = baked(light("sun", half_angle=0.0), 0.06, roof) * np.pi / 5
    assert off_diagonal(image) == pytest.approx([1, 1, 1, 0.5, 0, 0], abs=0.03)


def off_diagonal(image):
    """Return the mean of each column, without texels that are cut by the edge between two triangles."""
    return np.nanmean(np.where(np.eye(len(image), dtype=bool), np.nan, image), axis=0)


def test_many_lamps_give_the_sum():
    rng = np.random.default_rng(0)
    lamps = tuple(
        dataclasses.replace(light("point"), position=np.r_[rng.uniform(-3, 3, 2), rng.uniform(1, 3)])
        for _ in range(50)
    )
    floor = rectangle((-0.01, -0.01, 0), 0.02 * X, 0.02 * Y)
    mesh = quads(floor[None], [(1, 1, 6, 6)], [0], 16, "Floor")
    image = drive(Scene((mesh,), (BLACK,), lights=lamps), SETTINGS).image[0, 1:7, 1:7, 0]
    positions = np.array([lamp.position for lamp in lamps])
    expected = (5 / np.pi * positions[:, 2] / np.linalg.norm(positions, axis=1) ** 3).sum()
    assert image.mean() == pytest.approx(expected, rel=2e-3)
    assert image == pytest.approx(expected, rel=0.03)


def test_neighbours_together_give_a_dim_lamp_its_share():
    """Above a roof is a lamp that could be 20 times as bright, so most rays go to it."""
    roof = quads(rectangle((-50, -50, 3), 100 * X, 100 * Y)[None], [(9, 1, 2, 2)], [0], 16, "Roof")
    floor = quads(rectangle((-0.01, -0.01, 0), 0.02 * X, 0.02 * Y)[None], [(1, 1, 6, 6)], [0], 16, "Floor")
    lamps = light("point", 2.0), light("point", 4.0, strength=400.0)
    scene = Scene((floor, roof), (BLACK,), lights=lamps)
    few = dataclasses.replace(SETTINGS, light_samples=4)
    maps = [drive(scene, dataclasses.replace(few, seed=seed)).image[0, 1:7, 1:7, 0] for seed in range(5)]
    assert np.mean(maps, axis=(1, 2)) == pytest.approx(np.full(5, 5 / (np.pi * 4)), rel=0.12)


def test_a_bright_spot_of_the_sky_is_a_light():
    world = np.zeros((64, 128, 3), np.float32)
    world[50, 20] = 1000
    borders = np.cos(np.pi * np.array([50, 51]) / 64)
    angle, z = (borders[0] - borders[1]) * 2 * np.pi / 128, -borders.mean()
    floor = rectangle((-0.01, -0.01, 0), 0.02 * X, 0.02 * Y)
    mesh = quads(floor[None], [(1, 1, 6, 6)], [0], 16, "Floor")
    image = drive(Scene((mesh,), (BLACK,), world=world), SETTINGS).image[0, 1:7, 1:7, 0]
    assert image == pytest.approx(1000 * angle * z / np.pi, rel=0.01)


@pytest.mark.parametrize("compute", [devices.ComputeDevice, NoCompute])
@pytest.mark.parametrize("height", [4099, 16384])
def test_a_bright_pixel_at_the_pole_of_a_tall_panorama_has_its_light(height, compute, monkeypatch):
    """Its tent, continued to the pole, is 1 up to half a pixel from the pole and falls to 0 at 1.5 pixels."""
    monkeypatch.setattr(devices, "ComputeDevice", compute)
    world = np.zeros((height, 8, 3), np.float32)
    world[-1, 3] = 1e9
    floor = quads(rectangle((-0.01, -0.01, 0), 0.02 * X, 0.02 * Y)[None], [(1, 1, 6, 6)], [0], 16, "Floor")
    image = drive(Scene((floor,), (BLACK,), world=world), SETTINGS).image[0, 1:7, 1:7, 0]
    angle = 13 / 24 * (np.pi / height) ** 2 * 2 * np.pi / 8
    assert image.mean() == pytest.approx(1e9 * angle / np.pi, rel=0.005)


def test_pixels_of_the_sky_are_interpolated_at_edges_of_shadows():
    """A wall ends three quarters of a pixel beside a bright one, whose tent it covers by 1/32; so does one
    on the other side, which covers the rest."""
    world = np.zeros((64, 128, 3), np.float32)
    world[50, 20] = 1000
    azimuth = np.pi * (1 - (20 + 0.5 + 0.75) / 64)
    corner = np.array([np.cos(azimuth), np.sin(azimuth), 0])
    side = np.cross(Z, corner)
    floor = quads(rectangle((-1e-4, -1e-4, 0), 2e-4 * X, 2e-4 * Y)[None], [(1, 1, 6, 6)], [0], 16, "Floor")
    settings = dataclasses.replace(SETTINGS, light_samples=1024)
    light = []
    for way in (side, -side):
        wall = quads(rectangle(corner, 9 * way, 99 * Z)[None], [(9, 1, 5, 5)], [0], 16, "Wall")
        image = drive(Scene((floor, wall), (BLACK,), world=world), settings).image
        light.append(image[0, 1:7, 1:7, 0].mean())
    assert min(light) / sum(light) == pytest.approx(1 / 32, abs=0.004)


def test_shadow_masks_and_occlusion():
    settings = dataclasses.replace(SETTINGS, outputs=("shadow_mask", "ambient_occlusion"), ao_distance=0.0)
    edge = -0.03 + 3.5 / 6 * 0.06
    floor = rectangle((-0.03, -0.03, 0), 0.06 * X, 0.06 * Y)
    roof = rectangle((edge, -100, 0.5), 200 * X, 200 * Y)
    meshes = (
        quads(floor[None], [(1, 1, 6, 6)], [0], 16, "Floor"),
        quads(roof[None], [(9, 1, 5, 5)], [0], 16, "Roof"),
    )
    lamp = light("sun", half_angle=0.0)
    passes = drive(Scene(meshes, (BLACK,), lights=(lamp,)), settings).passes
    assert list(passes) == ["shadow_mask Lamp", "ambient_occlusion"]
    mask, open_share = (passes[name][0, 1:7, 1:7, 0] for name in passes)
    assert off_diagonal(mask) == pytest.approx([1, 1, 1, 0.5, 0, 0], abs=0.03)
    assert open_share.mean() == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize(("transmission", "warnings"), [
    (Transmission(), ("Light 'Lamp' is inside object 'Box' and lights nothing. Move it.",)),
    (Transmission(shadow=CLEAR), ()),
])  # fmt: skip
def test_a_lamp_inside_a_box_is_named(transmission, warnings):
    """Unless its shadow rays pass the box."""
    corners = np.array([(x, y, z) for z in (1, 3) for y in (-1, 1) for x in (-1, 1)], float)
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    charts = [(9, 1, 2, 2), (12, 1, 2, 2), (9, 4, 2, 2), (12, 4, 2, 2), (9, 7, 2, 2), (12, 7, 2, 2)]
    box = quads(corners[np.array(faces)], charts, [0] * 6, 16, "Box")
    floor = quads(rectangle((-1, -1, 0), 2 * X, 2 * Y)[None], [(1, 1, 6, 6)], [0], 16, "Floor")
    surface = dataclasses.replace(BLACK, transmission=transmission)
    report = drive(Scene((floor, box), (surface,), lights=(light("point"),)), SETTINGS).report
    assert report.warnings == warnings


def test_without_light_the_lightmap_is_black_and_says_so():
    floor = quads(rectangle((0, 0, 0), X, Y)[None], [(1, 1, 6, 6)], [0], 16, "Floor")
    lightmap = drive(Scene((floor,), (BLACK,)), SETTINGS)
    assert (lightmap.image == 0).all() and lightmap.report.warnings[0].startswith("Nothing emits light")


@pytest.mark.parametrize("outputs", [("combined",), ("direct",), ("indirect", "direct")])
def test_without_light_nothing_is_cast(outputs):
    """White surfaces, a lamp without power, a texture and a world that are black: all of it in vain."""
    white = dataclasses.replace(BLACK, reflectance=np.ones(3, np.float32))
    black = Texture("Black", np.zeros((3, 5, 3), np.float32), "UV")
    screen = dataclasses.replace(white, emission=np.ones(3, np.float32), emission_map=black)
    floor = quads(rectangle((0, 0, 0), X, Y)[None], [(1, 1, 6, 6)], [0], 16, "Floor")
    wall = quads(rectangle((0, 0, 0), Y, Z)[None], [(9, 1, 5, 7)], [1], 16, "Wall")
    wall = dataclasses.replace(wall, texture_uvs={"UV": wall.uvs})
    lamp = light("point", strength=np.zeros(3, np.float32))
    scene = Scene((floor, wall), (white, screen), world=np.zeros((2, 4, 3), np.float32), lights=(lamp,))
    lightmap, steps = drive_with_progress(scene, dataclasses.replace(SETTINGS, outputs=outputs))
    assert not [progress for progress in steps if progress.stage.startswith(("Visibility", "Bounce"))]
    assert all((image == 0).all() for image in lightmap.passes.values())
    assert lightmap.has_patch.sum() > 60 and list(lightmap.passes) == list(outputs)
    assert lightmap.report.warnings[0].startswith("Nothing emits light")
    assert (lightmap.report.method, lightmap.report.samples, lightmap.report.iterations) == ("none", 0, 0)
    assert lightmap.report.converged and lightmap.report.convergence_error == 0


def test_ambient_occlusion_needs_no_light():
    floor = quads(rectangle((0, 0, 0), X, Y)[None], [(1, 1, 6, 6)], [0], 16, "Floor")
    settings = dataclasses.replace(SETTINGS, outputs=("ambient_occlusion",))
    lightmap = drive(Scene((floor,), (BLACK,)), settings)
    assert (lightmap.image[0, 1:7, 1:7] == 1).all() and lightmap.report.warnings == ()


def test_the_underside_of_something_that_stands_on_a_floor_is_hidden():
    """It lies in the floor's plane; neither its light nor that of the floor beneath it is shown."""
    floor = quads(rectangle((-2, -2, 0), 4 * X, 4 * Y)[None], [(1, 1, 6, 6)], [0], 16, "Floor")
    foot = quads(rectangle((-0.5, -0.5, 0), Y, X)[None], [(9, 9, 6, 6)], [0], 16, "Foot")
    sides = np.stack(
        [
            rectangle((-0.5, -0.5, 0.4), X, Y),
            rectangle((-0.5, -0.5, 0), X, 0.4 * Z),
            rectangle((0.5, -0.5, 0), Y, 0.4 * Z),
            rectangle((0.5, 0.5, 0), -X, 0.4 * Z),
            rectangle((-0.5, 0.5, 0), -Y, 0.4 * Z),
        ]
    )
    charts = [(9, 1, 2, 2), (12, 1, 2, 2), (9, 4, 2, 2), (12, 4, 2, 2), (1, 9, 4, 4)]
    box = quads(sides, charts, [0] * 5, 16, "Box")
    lamps = (light("point"), dataclasses.replace(light("point"), position=np.array([0, 0, -2.0])))
    unfilled = dataclasses.replace(SETTINGS, margin=0, hide_seams=False, texel_samples=1)
    lightmap = drive(Scene((floor, foot, box), (BLACK,), lights=lamps), unfilled)
    assert (lightmap.display[0, 9:15, 9:15] == 0).all()
    shown, lit = lightmap.display[0, 1:7, 1:7], lightmap.image[0, 1:7, 1:7]
    assert (shown[:2] == lit[:2]).all() and (lit[:2] > 0).all()
    assert (shown[2:4, 2:4] == 0).all()


def profile(azimuths=37, polars=46):
    """Return a profile that is bright to the side of +x, and coloured; and what it stands for."""
    azimuth, polar = np.linspace(0, 2 * np.pi, azimuths), np.linspace(0, np.pi, polars)
    factors = shape(azimuth[:, None], polar)
    return Profile(azimuth.astype(np.float32), polar.astype(np.float32), factors.astype(np.float32))


def shape(azimuth, polar):
    grey = (1.2 + np.cos(polar)) * (1 + 0.5 * np.cos(azimuth - 1) * np.sin(polar) ** 2)
    return np.stack([grey, 0.5 * grey, 0 * grey + 1], axis=-1)


def towards(lamp, point):
    """Return the profile's factor from a lamp to a point, (..., 3)."""
    own = (point - lamp.position) @ (lamp.axes * lamp.stretch[:, None]).T
    azimuth = np.arctan2(own[..., 0], own[..., 1]) + np.pi
    return shape(azimuth, np.arctan2(np.hypot(own[..., 0], own[..., 1]), -own[..., 2]))


def colours(lamp, size=0.02):
    """Return mean direct E/pi of a square at the origin, (3,)."""
    floor = rectangle((-size / 2, -size / 2, 0), size * X, size * Y)
    scene = Scene((quads(floor[None], [(1, 1, 6, 6)], [0], 16, "Floor"),), (BLACK,), lights=(lamp,))
    return drive(scene, SETTINGS).image[0, 1:7, 1:7].mean(axis=(0, 1))


TURNED = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]


@pytest.mark.parametrize(
    ("axes", "stretch", "position"),
    [
        (DOWN, (1, 1, 1), (0, 0, 2)),
        (TURNED, (1, 1, 1), (1, -2, 1.5)),
        (TURNED * [[-1], [1], [1]], (1, 0.4, 2), (0.3, 0.1, 2)),
    ],
)
def test_a_profile_turns_and_stretches_with_its_lamp(axes, stretch, position):
    lamp = light("point", profile=profile())
    position, stretch = np.array(position, float), np.array(stretch, float)
    lamp = dataclasses.replace(lamp, position=position, axes=axes, stretch=stretch)
    expected = 5 * position[2] / np.linalg.norm(position) ** 3 / np.pi * towards(lamp, np.zeros(3))
    assert colours(lamp) == pytest.approx(expected, rel=5e-3)


def test_a_profile_of_an_area_light():
    lamp = light("area", size=np.array([1.0, 0.6]), profile=profile())
    lamp = dataclasses.replace(lamp, position=np.array([0.5, 0.2, 1.5]))
    x, y = np.stack(np.meshgrid(*[(np.arange(200) + 0.5) / 200 - 0.5] * 2), axis=0) * [[[1.0]], [[0.6]]]
    points = lamp.position + np.stack([x, y, 0 * x], axis=-1)
    d2 = (points**2).sum(axis=-1)
    lit = dataclasses.replace(lamp, position=np.zeros(3))
    brought = towards(lit, -points) * (points[..., 2] ** 2 / d2**2)[..., None]
    assert colours(lamp) == pytest.approx(5 * 0.6 / np.pi * brought.mean(axis=(0, 1)), rel=1e-2)


def test_a_profile_that_shines_only_straight_down_is_not_lost_among_others():
    """At its pole it has no solid angle of its own, so that its mean power must not be 0."""
    factors = np.zeros((2, 19, 3), np.float32)
    factors[:, 0] = 1
    angles = np.array([0, 2 * np.pi], np.float32), np.linspace(0, np.pi, 19).astype(np.float32)
    narrow = light("point", profile=Profile(*angles, factors))
    others = [dataclasses.replace(narrow, position=np.array([x, 9.0, 2.0])) for x in range(8)]
    size = 0.02
    floor = rectangle((-size / 2, -size / 2, 0), size * X, size * Y)
    meshes = (quads(floor[None], [(1, 1, 6, 6)], [0], 16, "Floor"),)
    lightmap = drive(Scene(meshes, (BLACK,), lights=(narrow, *others)), SETTINGS)
    assert lightmap.image[0, 1:7, 1:7].mean() == pytest.approx(5 / (np.pi * 4), rel=1e-2)


@pytest.mark.parametrize(
    ("kind", "power", "smooth"), [("point", 0, 0.7), ("spot", 1, 0), ("area", 2, 0), ("point", 2, 3.0)]
)
def test_falloff(kind, power, smooth):
    size = {"size": np.array([1e-2, 1e-2])} if kind == "area" else {}
    plain = light(kind, height=3.0, **size)
    lamp = dataclasses.replace(plain, falloff_power=power, falloff_smooth=smooth)
    assert colours(lamp) == pytest.approx(colours(plain) * 3**power * 9 / (smooth + 9), rel=5e-3)
