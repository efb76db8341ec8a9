"""Transmittance of surfaces along rays: RGB, by side of the surface and kind of ray."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Material, Scene, Texture
from engine.device.cl_device import ComputeDevice
from engine.scene.cutouts import BOUNCE, SHADOW, read_cutouts
from engine.scene.tints import EXACT, SIZE, tint_palette
from engine.scene.transmission import CLEAR, OPAQUE, Transmission, Transmittance
from engine.scene.triangles import join_meshes
from engine.visibility.rays.ray_tracer import RayTracer
from tests.analytic.scenes import quads, rectangle
from tests.transparency import uniform_transmission

BLACK = np.zeros(3, np.float32)
UP, DOWN = (0, 0, 1), (0, 0, -1)
UVS = np.float32([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]])


@pytest.fixture(scope="module")
def compute():
    return ComputeDevice()


def passing(*values):
    """Return a transmittance of three channels."""
    return Transmittance(np.float32(values))


def mapped(pixels, offset=0.0, scale=1.0, threshold=None, **changes):
    """Return the transmittance offset + scale * pixels, laid over a square of 1 m."""
    texture = Texture("Glass", np.float32(pixels), "Map", extension="extend", smooth=False)
    ends = (np.full(3, value, np.float32) for value in (offset, scale))
    return Transmittance(*ends, replace(texture, **changes), threshold)


def square(corner):
    return rectangle(corner, (1, 0, 0), (0, 1, 0))


def panes(*transmissions, origin=0.0):
    """Return squares of 1 m, 10 cm above each other, whose fronts look up, of materials of their own."""
    meshes = tuple(
        replace(
            quads(square((origin, origin, 0.1 * number))[None], [(1, 1, 5, 5)], [number], 16),
            texture_uvs={"Map": UVS, "Turned": UVS[:, :, ::-1]},
        )
        for number in range(len(transmissions))
    )  # fmt: skip
    materials = tuple(
        Material(f"Pane {number}", BLACK, BLACK, transmission=transmission)
        for number, transmission in enumerate(transmissions)
    )
    return Scene(meshes, materials)


def through(compute, scene, places=((0.3, 0.6),), direction=DOWN, kind=BOUNCE, origin=0.0):
    """Return what comes through all panes above and below some places, (k, 3)."""
    triangles = join_meshes(scene)
    rays = RayTracer(compute, triangles, read_cutouts(scene))
    starts = np.array([(origin + x, origin + y, -20.0 * direction[2]) for x, y in places])
    return rays.transmittance(starts - triangles.origin, np.tile(direction, (len(places), 1)), 50.0, kind)


@pytest.mark.parametrize("origin", [0.0, -7300.0])
def test_panes_multiply_each_channel(compute, origin):
    """Also where the light that is left differs by a thousand between channels, and far from the origin."""
    values = [(0.9, 0.3, 0.1), (0.7, 0.8, 0.1), (1.0, 0.5, 0.1)]
    scene = panes(*(uniform_transmission(passing(*value)) for value in values), origin=origin)
    assert through(compute, scene, origin=origin)[0] == pytest.approx(np.prod(values, axis=0), rel=1e-5)


@pytest.mark.parametrize(("direction", "kind", "expected"), [
    (DOWN, SHADOW, (0.9, 0.5, 0.1)),
    (DOWN, BOUNCE, (0.2, 0.4, 0.6)),
    (UP, SHADOW, (1.0, 1.0, 1.0)),
    (UP, BOUNCE, (0.3, 0.1, 0.0)),
])  # fmt: skip
def test_sides_and_kinds_of_rays_have_their_own(compute, direction, kind, expected):
    transmission = Transmission(passing(0.9, 0.5, 0.1), passing(0.2, 0.4, 0.6), CLEAR, passing(0.3, 0.1, 0.0))
    assert through(compute, panes(transmission), direction=direction, kind=kind)[0] == pytest.approx(expected)


@pytest.mark.parametrize(("kind", "expected"), [(SHADOW, 1), (BOUNCE, 0)])
def test_surfaces_clear_to_shadow_rays_alone(compute, kind, expected):
    scene = panes(Transmission(shadow=CLEAR, bounce=OPAQUE))
    assert (through(compute, scene, kind=kind) == expected).all()
    assert (through(compute, panes(Transmission(OPAQUE, CLEAR)), kind=kind) == 1 - expected).all()


def test_maps_vary_each_channel(compute):
    """Three columns by one row, on both sides of different UV maps, beside a grey map of another size."""
    colors = np.float32([[(1, 0, 0.5), (0.25, 1, 0), (0, 0.75, 1)]])
    grey = np.float32([0.0, 0.4, 1.0, 0.2, 0.6]).reshape(5, 1, 1)
    turned = mapped(colors, uv_map="Turned")
    scene = panes(
        Transmission(mapped(colors), mapped(colors, 0.1, 0.5), bounce_back=turned),
        uniform_transmission(mapped(grey)),
    )
    places = np.array([(0.1, 0.5), (0.5, 0.9), (0.9, 0.1)])
    column, row = (places * (3, 5)).astype(int).T
    grey_there = grey[row, 0]
    found = through(compute, scene, places, kind=SHADOW)
    assert found == pytest.approx(colors[0, column] * grey_there, abs=1e-4)
    assert through(compute, scene, places) == pytest.approx(
        (0.1 + 0.5 * colors[0, column]) * grey_there, abs=1e-4
    )
    from_below = colors[0, (places[:, 1] * 3).astype(int)] * grey_there
    assert through(compute, scene, places, direction=UP) == pytest.approx(from_below, abs=1e-4)


def test_thresholds_stop_or_pass_each_channel(compute):
    """Opacity at or above the threshold is 1, below it 0."""
    pixels = np.float32([[(0.5, 0.49, 0.51), (0.9, 0.1, 0.5)]])
    scene = panes(uniform_transmission(mapped(pixels, threshold=0.5)))
    found = through(compute, scene, [(0.2, 0.5), (0.8, 0.5)])
    assert found.tolist() == [[0, 0, 1], [1, 0, 0]]


def test_channels_of_grey_maps_are_kept_once():
    pixels = np.random.default_rng(2).random((7, 5, 1), np.float32)
    kept = read_cutouts(panes(uniform_transmission(mapped(np.repeat(pixels, 3, axis=2)))))
    assert len(kept.pixels) == pixels.size + 1 and not kept.tinted
    colored = pixels * np.float32([1, 1, 0.5])
    assert read_cutouts(panes(uniform_transmission(mapped(colored)))).tinted


def palette_of(*values):
    scene = panes(*(uniform_transmission(passing(*value)) for value in values))
    return tint_palette(read_cutouts(scene))


def test_a_palette_has_tints_of_constants_and_their_products():
    palette = palette_of((0.8, 0.4, 0.2), (0.5, 0.5, 0.5), (0.3, 0.6, 0.6), (0.0, 0.0, 0.0))
    exact = palette[: int(palette[0, 3]), :3]
    one, other = np.array([1, 0.5, 0.25]), np.array([0.5, 1, 1])
    for tint in (np.ones(3), one, other, one * other, one**3 * other, other**4):
        assert np.abs(exact - tint).max(axis=1).min() < 1e-6
    assert (palette[0, :3] == 1).all() and (palette[:, :3] <= 1).all()


def test_any_tint_is_a_mean_of_the_lattice():
    palette = palette_of((1.0, 0.5, 0.0))
    corners = palette[EXACT:, :3]
    assert len(palette) == SIZE and len(np.unique(corners, axis=0)) == len(corners) == 27
    assert {tuple(corner) for corner in np.round(np.linspace(0, 1, 2))[:, None].repeat(3, 1)} <= {
        tuple(corner) for corner in corners
    }


def test_more_tints_than_a_palette_holds_leave_the_lattice():
    values = np.random.default_rng(5).random((90, 3))
    palette = palette_of(*values)
    assert palette[0, 3] == EXACT and (palette[EXACT:, :3] == palette_of((1.0, 0.5, 0.0))[EXACT:, :3]).all()


def test_scenes_without_tints_have_no_palette():
    assert palette_of((0.5, 0.5, 0.5), (0.25, 0.25, 0.25)) is None
