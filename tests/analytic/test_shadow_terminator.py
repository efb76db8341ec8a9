"""The terminator on smoothly shaded facets."""

import dataclasses

import numpy as np
import pyopencl as cl
import pytest

from engine import Light, Material, Mesh, Scene, Settings
from engine.device.cl_device import ComputeDevice
from engine.patches.patch_materials import PatchMaterials
from engine.patches.patch_scene import PatchScene
from engine.scene.cutouts import read_cutouts
from engine.visibility.rays.ray_scene import RayScene
from engine.visibility.rays.receiver_records import RECEIVER
from tests.analytic.drive import drive, prepare
from tests.analytic.scenes import quads, rectangle
from tests.reference.cpu_patches import map_texels
from tests.rows import long

BLACK = Material("Black", np.zeros(3, np.float32), np.zeros(3, np.float32))
SETTINGS = Settings(
    resolution=64, hemicube=8, max_bounces=1, visibility="rays", light_samples=16, outputs=("direct",)
)


def ball(segments, rings, chart=(0.02, 0.02, 0.6, 0.96), inwards=False, turned=False):
    """Return a UV sphere of radius 1 that is shaded smooth, as Blender makes it.

    chart:    x, y, width and height of its chart on the lightmap
    inwards:  True if it is seen from inside
    turned:   True if its normals point against its faces
    """
    u, v = np.meshgrid(np.linspace(0, 1, segments + 1), np.linspace(0, 1, rings + 1))
    azimuth, polar = 2 * np.pi * u, np.pi * (1 - v)
    points = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=2
    )
    texels = np.stack([chart[0] + chart[2] * u, chart[1] + chart[3] * v], axis=2)
    corners = [(slice(a, a + rings), slice(b, b + segments)) for a, b in ((0, 0), (0, 1), (1, 1), (1, 0))]
    order = [[0, 1, 2], [0, 2, 3]] if not inwards else [[0, 2, 1], [0, 3, 2]]
    quad, uvs = (
        np.stack([grid[c] for c in corners], axis=2).reshape(-1, 4, grid.shape[2])
        for grid in (points, texels)
    )
    positions, uvs = quad[:, order].reshape(-1, 3, 3), uvs[:, order].reshape(-1, 3, 2)
    area = np.linalg.norm(
        np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0]), axis=1
    )
    positions, uvs = positions[area > 1e-9].astype(np.float32), uvs[area > 1e-9].astype(np.float32)
    normals = -positions if inwards != turned else positions
    index = np.arange(len(positions), dtype=np.int32)
    return Mesh("Ball", positions, normals.copy(), uvs, index, np.zeros_like(index), np.zeros_like(index))


def sun(direction):
    axis = np.array(direction) / np.linalg.norm(direction)
    across = np.cross(axis, [0, 0, 1])
    across /= np.linalg.norm(across)
    axes = np.stack([across, np.cross(axis, across), axis])
    return Light("Sun", "sun", np.zeros(3), axes, np.full(3, np.pi, np.float32), half_angle=0.0)


def point(where, strength):
    return Light("Point", "point", np.array(where, float), np.eye(3), np.full(3, strength, np.float32))


@pytest.mark.parametrize("origin", [3000.0, long(0.0)])
@pytest.mark.parametrize("kind", ["sun", "point"])
def test_light_ends_where_the_smooth_surface_turns_away(kind, origin):
    """The default UV sphere: E/pi is that of the smooth normals, without the steps of facets."""
    mesh = ball(32, 16)
    lamp = sun((0.6, -0.5, 0.62)) if kind == "sun" else point((1.7, -1.1, 1.3), 10.0)
    here = prepare(Scene((mesh,), (BLACK,)), 64)
    normal, centre = here.geometry.normal.astype(float), here.geometry.center + here.triangles.origin
    way = np.broadcast_to(lamp.axes[2], normal.shape) if kind == "sun" else lamp.position - centre
    distance = 1 if kind == "sun" else np.linalg.norm(way, axis=1)
    cosine = (normal * way).sum(axis=1) / distance
    expected = np.maximum(cosine, 0) * lamp.strength[0] / np.pi / distance**2

    moved = dataclasses.replace(mesh, positions=mesh.positions + np.float32(origin))
    lamp = dataclasses.replace(lamp, position=lamp.position + origin)
    light = (
        drive(Scene((moved,), (BLACK,), lights=(lamp,)), SETTINGS)
        .image[0]
        .reshape(-1, 3)[here.patches.texel, 0]
    )
    edge = np.abs(cosine) < 0.25
    assert edge.sum() > 100
    assert light[edge] / expected.max() == pytest.approx(expected[edge] / expected.max(), abs=0.015)
    assert light[cosine < -0.1].max() == 0


@pytest.mark.parametrize("distance", [1.001, 1.02, 1.05])
def test_no_light_comes_through_a_thin_wall_beside_a_smooth_surface(distance):
    """Facets of 45 degrees: the planes of their corners meet 0.08 m outside of them, beyond the wall.

    Suns that graze the wall from behind graze the facets that lean towards it, too.
    """
    wall = rectangle((-200, distance, -200), (0, 0, 400), (400, 0, 0))
    meshes = (ball(8, 8), quads(wall[None], [(50, 1, 6, 6)], [0], 64, "Wall"))
    lamps = tuple(sun((x, 0.05, z)) for x, z in ((1, 0.3), (-1, 0.1), (0.2, 1), (0.1, -1)))
    image = drive(Scene(meshes, (BLACK,), lights=lamps), SETTINGS).image[0]
    assert image[:, 48:].max() > 0
    assert (image[:, :42] == 0).all()


def test_a_bright_ball_lights_nothing_of_itself():
    """Its normals lean over its faces, and its rays start above them, but faces of a ball look away."""
    glow = dataclasses.replace(BLACK, emission=np.full(3, 5, np.float32))
    floor = quads(
        rectangle((-50, -50, -2), (100, 0, 0), (0, 100, 0))[None], [(50, 1, 6, 6)], [1], 64, "Floor"
    )
    image = drive(Scene((ball(12, 8), floor), (glow, BLACK)), SETTINGS).image[0]
    assert image[:, 48:].max() > 0
    assert (image[:, :42] == 0).all()


def lifted(*meshes):
    """Return the fraction of the lift of every patch, (n,)."""
    scene = Scene(meshes, (BLACK,))
    here = prepare(scene, 64)
    dark = np.zeros((len(here.patches), 3), np.float32)
    texels, surfaces = map_texels(scene, here.patches), PatchMaterials(dark, dark)
    cutouts = read_cutouts(scene)
    patch_scene = PatchScene(here.triangles, cutouts, here.patches, here.geometry, surfaces, texels, ())
    compute = ComputeDevice()
    records = RECEIVER.array(len(here.patches))
    rays = RayScene(compute, patch_scene)
    cl.enqueue_copy(compute.queue, records, rays.receivers)
    return records["lifted"]


@pytest.mark.long
def test_only_smooth_surfaces_that_bulge_are_lifted():
    bulging = ball(32, 16)
    corners = bulging.positions
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    faceted = dataclasses.replace(bulging, normals=np.repeat(flat[:, None], 3, axis=1))
    assert (lifted(bulging) == 1).all()
    for other in (faceted, ball(32, 16, inwards=True), ball(32, 16, turned=True)):
        assert (lifted(other) == 0).all()


def test_lifts_end_half_way_to_what_is_above():
    lid = quads(rectangle((1.001, -20, -20), (0, 0, 40), (0, 40, 0))[None], [(50, 1, 6, 6)], [0], 64, "Lid")
    fraction = lifted(ball(8, 8), lid)
    assert 0 < fraction[fraction > 0].min() < 0.35 and fraction.max() == 1
