"""Light through tinted surfaces, in bakes whose light is known."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Material, Scene, Settings, Texture
from engine.errors import SceneError
from engine.scene.checks import check_material
from engine.scene.model import Light
from engine.scene.transmission import CLEAR, OPAQUE, Transmission, Transmittance
from tests.analytic.drive import drive
from tests.analytic.scenes import material, quads, rectangle, room_walls
from tests.transparency import uniform_transmission

SETTINGS = Settings(resolution=32, hemicube=16, samples=2048, sample_emission=False, max_bounces=2)
BLACK = np.zeros(3, np.float32)
X, Y, Z = np.eye(3)
UVS = np.float32([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]])
TINTS = np.float32([(0.9, 0.5, 0.1), (0.5, 0.5, 0.9), (1.0, 0.2, 0.6)])


def pane(*passed, reflectance=BLACK):
    transmission = uniform_transmission(Transmittance(np.float32(passed)))
    return Material("Pane", np.float32(reflectance), BLACK, transmission=transmission)


def under_panes(*materials, world=BLACK, lights=(), origin=0.0):
    """Return a black square of 1 m below wide panes, one above the other, whose fronts look down."""
    at = np.full(3, origin)
    meshes = [quads(rectangle(at, X, Y)[None], [(1, 1, 7, 7)], [0], 32, "Floor")]
    for number in range(len(materials)):
        corners = rectangle(at + np.array([-100, -100, 0.02 + 0.01 * number]), 200 * Y, 200 * X)
        mesh = quads(corners[None], [(10, 1 + 4 * number, 3, 3)], [1 + number], 32, f"Pane {number}")
        meshes.append(replace(mesh, texture_uvs={"Map": UVS}))
    surfaces = (Material("Black", BLACK, BLACK), *materials)
    return Scene(tuple(meshes), surfaces, world=np.asarray(world, np.float32), lights=lights)


def light_of(scene, **changes):
    """Return the mean E/pi of the floor, (3,)."""
    return drive(scene, replace(SETTINGS, **changes)).image[0, 1:8, 1:8].reshape(-1, 3).mean(axis=0)


def sun(*irradiance):
    return Light("Sun", "sun", np.zeros(3), np.eye(3), np.float32(irradiance) * np.float32(np.pi))


@pytest.mark.parametrize("origin", [0.0, 5100.0])
def test_a_stack_of_panes_tints_sun_and_sky(origin):
    """The sun by shadow rays, the sky by gathered light: each by the product, of lights of two colors."""
    panes = [pane(*tint) for tint in TINTS]
    scene = under_panes(*panes, world=(1, 2, 4), lights=(sun(5, 3, 2),), origin=origin)
    expected = TINTS.prod(axis=0) * np.add((1, 2, 4), (5, 3, 2))
    assert light_of(scene) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(("shadow", "bounce"), [(CLEAR, OPAQUE), (OPAQUE, CLEAR)])
def test_lamps_and_gathered_light_have_their_own_rays(shadow, bounce):
    """A red sun through SHADOW, a green sky that is gathered, and its blue sun-like spot that is sampled."""
    world = np.zeros((16, 32, 3), np.float32)
    world[..., 1], world[15, :, 2] = 0.5, 400.0
    back = Transmission(shadow, bounce)
    scene = under_panes(replace(pane(0, 0, 0), transmission=back), world=world, lights=(sun(3, 0, 0),))
    light = light_of(scene, sample_emission=True)
    assert (light > 0.01).tolist() == ([True, False, False] if shadow is CLEAR else [False, True, True])


def test_sampled_and_gathered_sky_are_tinted_alike():
    world = np.full((16, 32, 3), 0.2, np.float32)
    world[13, 3:7] = 30.0
    open_sky = light_of(under_panes(world=world), sample_emission=True)
    light = light_of(under_panes(pane(0.9, 0.5, 0.1), world=world), sample_emission=True)
    assert light == pytest.approx(open_sky * (0.9, 0.5, 0.1), rel=0.04)


def test_textures_tint_by_their_mean():
    """Fine stripes of colors that no palette holds: light of all of them mixes."""
    pixels = np.float32([(1.0, 0.3, 0.1), (0.15, 0.85, 0.7), (0.6, 0.2, 0.95)])[None].repeat(3, axis=0)
    texture = Texture("Stripes", pixels, "Map", np.diag([2000.0, 1500.0, 1.0])[:2], smooth=False)
    seen = Transmittance(np.zeros(3, np.float32), np.ones(3, np.float32), texture)
    surface = Material("Curtain", BLACK, BLACK, transmission=uniform_transmission(seen))
    scene = under_panes(surface, world=np.ones(3))
    assert light_of(scene) == pytest.approx(pixels.mean(axis=(0, 1)), rel=0.03)


def test_a_tinted_sheet_that_absorbs_nothing_leaves_a_furnace_even():
    """The sheet reflects all light that it does not transmit: its opaque part has a blue reflectance of 8."""
    passed = np.float32([0.9, 0.5, 0.2])
    both = Transmittance(passed)
    sheet = Material(
        "Sheet", (1 - passed) / (1 - passed.max()), BLACK, transmission=Transmission(both, both, CLEAR, CLEAR)
    )
    walls = quads(room_walls(1, 1, 1), [(1 + 6 * i, 1, 5, 5) for i in range(5)] + [(1, 7, 5, 5)], [0] * 6, 32)
    middle = (rectangle((0, 0, 0.5), X, Y), rectangle((0, 0, 0.499), Y, X))
    sheets = quads(np.stack(middle), [(8, 7, 5, 5), (15, 7, 5, 5)], [1, 1], 32, "Sheets")
    scene = Scene((walls, sheets), (material("Wall", 0.5, 0.5), sheet))
    check_material(sheet)
    image = drive(scene, replace(SETTINGS, max_bounces=80, samples=1024)).image[0]
    found = np.concatenate([image[1:6, 1 + 6 * i : 6 + 6 * i].reshape(-1, 3) for i in range(5)])
    assert found.mean(axis=0) == pytest.approx(np.ones(3), rel=0.02)


@pytest.mark.parametrize(("passed", "reflectance"), [
    ((0.9, 0.5, 0.2), (1.0, 5.1, 8.0)), ((0.5, 0.5, 0.5), (1.1, 0.5, 0.5)), ((1.0, 0.5, 0.5), (np.nan, 0, 0)),
])  # fmt: skip
def test_more_light_than_comes_in_is_an_error(passed, reflectance):
    with pytest.raises(SceneError, match="'Pane'.*reflects and passes more light than it receives. Correct"):
        check_material(pane(*passed, reflectance=reflectance))


def test_a_tint_that_nothing_wears_changes_nothing():
    """Kernels compiled with tints give the same light as kernels without, except for rounding of sums."""
    walls = quads(room_walls(1, 1, 1), [(1 + 6 * i, 1, 5, 5) for i in range(5)] + [(1, 7, 5, 5)], [0] * 6, 32)
    pictures = [
        drive(Scene((walls,), (material("Wall", 0.5, 0.5), *more), lights=(sun(1, 1, 1),)), SETTINGS).image
        for more in ((), (pane(0.9, 0.5, 0.2),))
    ]
    assert pictures[0] == pytest.approx(pictures[1], rel=1e-5)


def test_groups_and_directions_of_tinted_light_sum_up():
    names = ("Suns", "Outside")
    scene = under_panes(
        pane(0.9, 0.5, 0.1), world=(1, 2, 4), lights=(replace(sun(5, 3, 2), light_group="Suns"),)
    )
    scene = replace(scene, light_groups=names, world_light_group="Outside")
    outputs = ("combined", "light_groups", "dominant_direction")
    made = drive(scene, replace(SETTINGS, outputs=outputs)).passes
    groups = [values for name, values in made.items() if any(group in name for group in names)]
    assert len(groups) == 2
    assert sum(groups)[0, 1:8, 1:8] == pytest.approx(made["combined"][0, 1:8, 1:8], rel=0.02)
