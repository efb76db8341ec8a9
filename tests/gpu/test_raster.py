from dataclasses import replace

import numpy as np
import pytest

from engine.device.gl_context import GraphicsContext
from engine.device.slice_limits import drawing_limits
from engine.device.time_slicer import TimeSlicer
from engine.gather.glsl_integrator import GlslIntegrator
from engine.gather.opencl_integrator import CopiedIntegrator
from engine.scene.cutouts import read_cutouts
from engine.scene.triangles import join_meshes
from engine.visibility.raster.draw_paths import available_paths
from engine.visibility.raster.raster import HemicubeRaster
from engine.visibility.raster.targets import RadianceTarget
from engine.visibility.raster.tiles import Tiles
from engine.visibility.raster.triangle_clusters import TriangleClusters
from engine.visibility.views.hemicube import face_rows, frames, matrices, multiplier_map, rotations
from tests.analytic.scenes import furnace, sphere
from tests.transparency import CLEAR_BACK, transparent

#: Frame along the axes, nothing below the horizon.
UPRIGHT = np.float32([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1]])
WORLD = np.float32([0.25, 0.5, 0.75])
SKY = WORLD.reshape(1, 1, 3)


def drawing(graphics, tiles, count, emission=0.0, eye=(0.5, 0.5, 0.5), nothing=(*WORLD, 1.0), before=0.0):
    """Draw `count` hemicubes inside (or outside) the furnace; every patch shines with its number."""
    scene = furnace(0.5, 1.0)
    triangles = join_meshes(scene)
    texel_to_patch = np.ones((1, 31, 31), np.uint32)
    target = RadianceTarget(graphics, tiles, np.full((1, 3), emission, np.float32), nothing)
    raster = HemicubeRaster(graphics, tiles, triangles, read_cutouts(scene), texel_to_patch, target)
    target.texture.write(np.full((tiles.layers, tiles.height, tiles.width, 4), before, np.float32).tobytes())
    target.set_radiance(np.full((1, 3), 2, np.float32))
    frame = frames(np.tile([0.0, 0.0, 1.0], (count, 1)), rotations(1, np.arange(count)))
    eyes = np.tile(np.array(eye) - triangles.origin, (count, 1))
    assert (
        list(
            raster.draw(
                matrices(frame, eyes, np.full(count, 1e-4), graphics.reversed_depth),
                TimeSlicer(drawing_limits(1)),
            )
        )[-1]
        == count
    )
    return raster


def drawn(graphics, tiles, count, **options):
    """Draw as `drawing`; return the target and its content."""
    target = drawing(graphics, tiles, count, **options).target
    image = np.frombuffer(target.texture.read(), np.float32)
    return target, image.reshape(tiles.layers, tiles.height, tiles.width, 4)


@pytest.mark.parametrize("tiles", [Tiles(16, 3, 1, 4), Tiles(8, 4, 2, 2), Tiles(32, 1, 1, 3)])
def test_every_slot_and_no_more_is_filled(graphics, tiles):
    count = tiles.capacity - 1
    _, image = drawn(graphics, tiles, count)
    x, y = tiles.origin(tiles.per_layer - 1)
    last = image[-1, y : y + 3 * tiles.n, x : x + tiles.n].copy()
    assert (last[..., :3] == WORLD).all()
    image = image.copy()
    image[-1, y : y + 3 * tiles.n, x : x + tiles.n] = 2
    assert (image[..., :3] == 2).all()


def test_back_faces_show_emission_and_are_counted(graphics):
    """Seen from below, the cube's outer sides are back faces: black but for their emission."""
    tiles = Tiles(32, 1, 1, 1)
    _, image = drawn(graphics, tiles, 1, emission=0.125, eye=(0.5, 0.5, -0.5))
    seen = image[0, :32, :, 3]
    assert (image[0, :32, :, :3][seen == 0] == 0.125).all() and (seen == 0).any()
    assert (image[0, :32, :, :3][seen == 1] == WORLD).all() and (seen == 1).any()


def pictures(graphics, tiles, path=None, culling=True, **changes):
    """Draw a sphere of 768 triangles seen from within and without; every texel of the lightmap is a patch."""
    scene = sphere()
    scene = replace(scene, materials=tuple(replace(m, **changes) for m in scene.materials))
    triangles = join_meshes(scene)
    target = RadianceTarget(graphics, tiles, np.zeros((61 * 61, 3), np.float32), (*WORLD, 1.0))
    target.set_radiance(np.random.default_rng(4).random((61 * 61, 3), np.float32))
    texel_to_patch = np.arange(61 * 61, dtype=np.uint32).reshape(1, 61, 61)
    arguments = (graphics, tiles, triangles, read_cutouts(scene), texel_to_patch, target, path, culling)
    raster = HemicubeRaster(*arguments)
    count = tiles.capacity - 1
    chosen = np.linspace(0, len(triangles.positions) - 1, count).astype(int)
    normal = triangles.normals[chosen, 0].astype(np.float64)
    eyes = triangles.positions[chosen].mean(axis=1) + np.resize([1e-3, -0.5], (count, 1)) * normal
    frame = frames(normal, rotations(1, np.arange(count)))
    list(
        raster.draw(
            matrices(frame, eyes, np.full(count, 1e-4), graphics.reversed_depth),
            TimeSlicer(drawing_limits(2)),
        )
    )
    return target.texture.read(), raster.path


@pytest.mark.parametrize(
    "changes",
    [{}, {"transmission": transparent(0.6)}, {"transmission": CLEAR_BACK}],
    ids=["opaque", "thin", "clear back"],
)
@pytest.mark.parametrize("tiles", [Tiles(16, 3, 1, 5), Tiles(8, 4, 2, 3)])
def test_all_ways_to_draw_give_the_same_bits(graphics, tiles, changes):
    reference, _ = pictures(graphics, tiles, "geometry", culling=False, **changes)
    assert len(set(np.frombuffer(reference, np.float32))) > 100
    for path in available_paths(graphics):
        for culling in (True, False):
            assert pictures(graphics, tiles, path, culling, **changes) == (reference, path)


def test_the_fastest_way_is_kept_and_draws_the_same(graphics):
    tiles = Tiles(16, 3, 1, 5)
    picture, path = pictures(graphics, tiles)
    assert path in available_paths(graphics)
    assert picture == pictures(graphics, tiles, "geometry", culling=False)[0]


def test_drivers_without_draw_commands_in_buffers_draw_the_same(graphics, monkeypatch):
    tiles = Tiles(16, 3, 1, 3)
    pictures_indirect = [pictures(graphics, tiles, path)[0] for path in available_paths(graphics)]
    monkeypatch.setattr(graphics, "indirect", False)
    assert pictures_indirect == [pictures(graphics, tiles, path)[0] for path in available_paths(graphics)]


def test_no_cluster_that_a_face_sees_is_left_out():
    """A triangle with a corner within a face's frustum belongs to a cluster that the face sees."""
    random = np.random.default_rng(3)
    corners = random.normal(size=(5000, 1, 3)) + random.normal(size=(5000, 3, 3)) * 0.1
    clusters = TriangleClusters(corners.astype(np.float32), np.zeros(5000, bool))
    frame = frames(np.float64([[0.6, 0, 0.8], [0, -1, 0]]), np.float64([0.3, 2.0]))
    matrix = matrices(frame, np.float64([[1, 0.5, 1], [-1, 1, 0]]), np.full(2, 1e-4), True)
    seen = clusters.visible(matrix)
    homogeneous = np.append(corners, np.ones((5000, 3, 1)), axis=2)
    clip = np.einsum("mfij,tkj->mftki", matrix.astype(np.float64), homogeneous)
    inside = (np.abs(clip[..., :2]) < clip[..., 3:]).all(axis=-1).any(axis=-1)
    cluster = np.empty(5000, int)
    cluster[clusters.order] = np.repeat(np.arange(len(clusters)), np.diff(clusters.first))
    assert (seen[cluster].transpose(1, 2, 0) | ~inside).all()
    assert len(clusters) > 50 and seen.mean() < 0.5


def test_see_through_backs_are_left_out():
    """A grid that faces up is seen from above, not from below unless its backs are opaque."""
    x, y = np.meshgrid(np.arange(-10, 10), np.arange(-10, 10))
    corner = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)[:, None] / np.float32(10)
    positions = (corner + np.float32([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]])).astype(np.float32)
    frame = frames(np.float64([[0, 0, -1], [0, 0, 1]]), np.zeros(2))
    matrix = matrices(frame, np.float64([[0, 0, 1.5], [0, 0, -1.5]]), np.full(2, 1e-4), True)
    one_sided, opaque = (
        TriangleClusters(positions, np.full(400, culled)).visible(matrix) for culled in (True, False)
    )
    assert opaque[:, :, 0].all() and one_sided[:, 0, 0].all() and not one_sided[:, 1].any()


@pytest.mark.parametrize("tiles", [Tiles(16, 3, 1, 3), Tiles(8, 4, 2, 2), Tiles(128, 1, 1, 1)])
def test_kernels_equal_a_sum_in_double_precision(graphics, compute, tiles):
    raster = drawing(graphics, tiles, tiles.capacity)
    target = raster.target
    values = np.random.default_rng(5).random((tiles.layers, tiles.height, tiles.width, 4), np.float32)
    target.texture.write(values.tobytes())
    upright = np.tile(UPRIGHT, (tiles.capacity, 1, 1))
    in_cl = CopiedIntegrator(compute, tiles, target.texture, SKY).integrate(upright)
    in_gl = GlslIntegrator(graphics, tiles, target.texture, raster.depth, SKY).integrate(upright)
    weights = multiplier_map(tiles.n).astype(np.float64)
    for slot in range(tiles.capacity):
        layer, tile = divmod(slot, tiles.per_layer)
        x, y = tiles.origin(tile)
        cube = values[layer, y : y + 3 * tiles.n, x : x + tiles.n].astype(np.float64)
        for result in (in_cl, in_gl):
            np.testing.assert_allclose(result[slot], np.einsum("yx,yxc->c", weights, cube), rtol=2e-6)


@pytest.mark.parametrize("nothing", [(*WORLD, 1.0), (0.0, 0.0, 0.0, 2.0)])
@pytest.mark.parametrize("eye", [(0.5, 0.5, 0.5), (0.5, 0.5, -0.5), (0.3, 0.6, 1.5)])
def test_depth_tells_where_nothing_was_drawn(graphics, compute, eye, nothing):
    """Colours of an earlier batch stay where the sky is seen, and do not count."""
    tiles = Tiles(16, 3, 1, 1)
    upright = np.tile(UPRIGHT, (3, 1, 1))
    cleared = drawing(graphics, tiles, 3, eye=eye, nothing=nothing)
    in_cl = CopiedIntegrator(compute, tiles, cleared.target.texture, SKY).integrate(upright)
    kept = drawing(graphics, tiles, 3, eye=eye, nothing=None, before=7.0)
    in_gl = GlslIntegrator(graphics, tiles, kept.target.texture, kept.depth, SKY).integrate(upright)
    assert in_gl == pytest.approx(in_cl, rel=1e-5)


def test_layout_has_one_face_after_another():
    rows = face_rows(16)
    assert rows == [(0, 16), (16, 8), (24, 8), (32, 8), (40, 8)]


def test_half_floats_are_rounded_and_never_infinite(graphics):
    """Patches of every brightness fill hemicubes; float16 holds up to 65504."""
    tiles, radiance = Tiles(8, 3, 1, 1), np.float32([[1e6, 0.123456, 3e-5]])
    dark = np.zeros((1, 3), np.float32)
    target = RadianceTarget(graphics, tiles, dark, None, half=True)
    target.set_radiance(radiance)
    scene = furnace(0.5, 1.0)
    texel_to_patch = np.ones((1, 31, 31), np.uint32)
    arguments = (graphics, tiles, join_meshes(scene), read_cutouts(scene), texel_to_patch, target)
    raster = HemicubeRaster(*arguments)
    frame = frames(np.tile([0.0, 0.0, 1.0], (3, 1)), np.zeros(3))
    list(
        raster.draw(
            matrices(frame, np.zeros((3, 3)), np.full(3, 1e-4), graphics.reversed_depth),
            TimeSlicer(drawing_limits(1)),
        )
    )
    integrator = GlslIntegrator(graphics, tiles, target.texture, raster.depth, SKY)
    light = integrator.integrate(np.tile(UPRIGHT, (3, 1, 1)))
    assert light == pytest.approx(np.tile([65504, 0.123456, 3e-5, 1], (3, 1)), rel=1e-3)


def test_standard_depth_draws_the_same_picture(graphics):
    """A driver without clip control (OpenGL 4.1) uses the usual depth range."""
    tiles = Tiles(32, 3, 1, 1)
    _, reversed_image = drawn(graphics, tiles, 3, eye=(0.3, 0.6, 0.2))
    plain = GraphicsContext()
    try:
        plain.raw("glClipControl", 0x8CA1, 0x935E)
        plain.reversed_depth = False
        _, image = drawn(plain, tiles, 3, eye=(0.3, 0.6, 0.2))
    finally:
        plain.release()
    assert (image == reversed_image).all()
