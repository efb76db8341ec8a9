"""The GPU path against the processor: hemicube images, their integrals, whole bakes, Gauss-Seidel."""

import dataclasses

import numpy as np
import pytest

from engine import Scene, Settings
from engine.device.cl_device import ComputeDevice
from engine.device.gl_context import GraphicsContext
from engine.device.host_copy import HostCopy
from engine.device.slice_limits import drawing_limits
from engine.device.time_slicer import TimeSlicer
from engine.gather.opencl_integrator import HemicubeIntegrator
from engine.patches.patch_list import list_patches
from engine.scene.cutouts import read_cutouts
from engine.scene.model import BackSide
from engine.visibility.raster.raster import HemicubeRaster
from engine.visibility.raster.targets import RadianceTarget
from engine.visibility.raster.tiles import plan_tiles
from engine.visibility.views.hemicube import matrices, multiplier_map
from engine.visibility.views.viewpoints import viewpoints
from tests.analytic import scenes
from tests.analytic.drive import Prepared, drive, irradiance, prepare
from tests.reference import cpu_hemicubes
from tests.reference.cpu_patches import map_texels
from tests.reference.form_factors import form_factors
from tests.reference.gauss_seidel import gather, gauss_seidel
from tests.rows import long

N = 32
SETTINGS = Settings(resolution=128, hemicube=N, sample_emission=False, visibility="raster", accelerate=False)


@dataclasses.dataclass
class Hemicubes:
    """Hemicubes of a few patches of the nine-quad room; the radiance of a patch is (index, face + 1, 1).

    cast:    (m, 3n, n, 4) float32, ray by ray
    drawn:   (m, 3n, n, 4) float32, by OpenGL
    summed:  (m, 4) float32, `drawn` integrated by OpenCL
    views:   what the rays saw
    """

    prepared: Prepared
    cast: np.ndarray
    drawn: np.ndarray
    summed: np.ndarray
    views: list[cpu_hemicubes.View]


@pytest.fixture(scope="module")
def room() -> Prepared:
    """Return the nine-quad room with its patches."""
    return prepare(scenes.nine_quad_room(), 128)


@pytest.fixture(scope="module")
def hemicubes(room) -> Hemicubes:
    """Draw and cast the hemicubes of 200 patches of the nine-quad room."""
    chosen = np.random.default_rng(0).permutation(len(room.patches))[:200]
    index = np.arange(len(room.patches))
    identity = np.stack([index, room.face + 1, np.ones(len(index))], axis=1).astype(np.float32)
    reference = room.hemicubes(SETTINGS)
    views = [reference.view(int(patch)) for patch in chosen]
    cast = np.stack([reference.image(view, identity) for view in views])
    drawn, summed = draw(room, chosen, identity)
    return Hemicubes(room, cast, drawn, summed, views)


def draw(room: Prepared, chosen: np.ndarray, radiance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Draw and integrate the hemicubes of that sample on the GPU path."""
    tiles = plan_tiles(SETTINGS, len(chosen))
    graphics = GraphicsContext()
    try:
        compute = ComputeDevice()
        texel_to_patch = map_texels(room.scene, room.patches)
        target = RadianceTarget(graphics, tiles, room.emission, (*room.scene.world, 1.0))
        cutouts = read_cutouts(room.scene)
        raster = HemicubeRaster(graphics, tiles, room.triangles, cutouts, texel_to_patch, target)
        target.set_radiance(radiance)
        points = viewpoints(room.triangles, room.geometry, SETTINGS)
        frame, eye, near = (values[chosen] for values in (points.frame, points.eye, points.near))
        frames = points.frames[chosen]
        views = matrices(frame, eye, near, graphics.reversed_depth)
        assert list(raster.draw(views, TimeSlicer(drawing_limits(tiles.capacity)))) == [len(chosen)]
        copy = HostCopy(compute, target.texture)
        summed = HemicubeIntegrator(compute, tiles, np.zeros((1, 1, 3), np.float32)).integrate(
            copy.update(), frames
        )
        array = np.frombuffer(target.texture.read(), np.float32)
    finally:
        graphics.release()
    array = array.reshape(tiles.layers, tiles.rows, 3 * N, tiles.columns, N, 4)
    images = array.transpose(0, 1, 3, 2, 4, 5).reshape(-1, 3 * N, N, 4)
    return images[: len(chosen)], summed


def test_patch_list_is_the_same(room):
    graphics = GraphicsContext()
    try:
        drawn = list_patches(graphics, room.scene, room.triangles, 128)
    finally:
        graphics.release()
    expected = room.patches
    assert len(drawn) == len(expected) == 10700
    for name in ("atlas", "texel"):
        assert np.array_equal(getattr(drawn, name), getattr(expected, name))
    assert np.array_equal(drawn.triangle // 2, expected.triangle // 2)
    same = drawn.triangle == expected.triangle
    assert drawn.barycentric[same] == pytest.approx(expected.barycentric[same], abs=1e-5)

    # A centre on the diagonal of a quad may belong to either triangle.
    assert np.abs(expected.barycentric[~same]).min(axis=1).max(initial=0) < 1e-6


def test_kernels_integrate_the_same_images_alike(hemicubes):
    multiplier = multiplier_map(N)
    expected = np.array([cpu_hemicubes.integrate(image, multiplier) for image in hemicubes.drawn])
    assert hemicubes.summed == pytest.approx(expected, rel=1e-5, abs=1e-7)


def test_drawn_hemicubes_differ_from_cast_ones_at_edges_only(hemicubes):
    drawn, cast = hemicubes.drawn, hemicubes.cast
    assert (drawn[..., 1] != cast[..., 1]).mean() < 5e-4

    # The patch may be the next one on the same face: GPUs round a look-up between two texels differently.
    assert (drawn != cast).any(axis=3).mean() < 3e-3

    # Another face is seen only where faces meet in the cast image. (Stacked faces meet in their rows,
    # too; that widens the edges by a row, which is fair: they meet in space as well.)
    face = cast[..., 1]
    shifted = np.pad(face, [(0, 0), (1, 1), (1, 1)], mode="edge")
    around = [shifted[:, y : y + 3 * N, x : x + N] for y in range(3) for x in range(3)]
    at_edge = np.max(around, axis=0) != np.min(around, axis=0)
    other = (drawn[..., [1, 3]] != cast[..., [1, 3]]).any(axis=3)
    assert at_edge[other].mean() > 0.9


def test_drawn_and_cast_hemicubes_give_the_same_irradiance(hemicubes, room):
    reference = room.hemicubes(SETTINGS)
    radiance = room.emission + 0.1 + 0.05 * room.face[:, None].astype(np.float32)
    cast = reference.gather_views(hemicubes.views, radiance)

    # Fronts hold the identity of a patch: put its radiance there. Backs hold their emission already.
    drawn, front = hemicubes.drawn, hemicubes.drawn[..., 3] == 1
    owned = front & (drawn[..., 1] > 0)
    image = np.where(front[..., None], 0, drawn[..., :3])
    image[owned] = radiance[drawn[owned, 0].astype(int)]
    relative = np.einsum("myxc,yx->mc", image, multiplier_map(N)) / cast[:, :3] - 1
    assert np.median(np.abs(relative)) < 1e-5
    assert np.quantile(np.abs(relative), 0.98) < 1e-3
    assert abs(relative.mean()) < 1e-3


@pytest.mark.parametrize(("iterations", "median"), [(1, 1e-6), (6, 5e-4)])
def test_a_whole_bake_equals_the_processor(iterations, median):
    """Most patches are equal to rounding; what the edges of faces change, later iterations spread."""
    mesh = scenes.furnace(0, 0).meshes[0]
    colours = np.random.default_rng(0).uniform(0.1, 0.9, (6, 3))
    materials = tuple(scenes.material(f"Wall {i}", rho, 2.0 * (i == 1)) for i, rho in enumerate(colours))
    scene = Scene((dataclasses.replace(mesh, material=mesh.face),), materials)
    settings = Settings(resolution=32, hemicube=16, max_bounces=iterations, tolerance=0, method="paper")
    prepared = prepare(scene, 32)
    expected = prepared.solution(prepared.hemicubes(settings), settings).irradiance
    relative = irradiance(drive(scene, settings))[expected > 0] / expected[expected > 0] - 1
    assert np.median(np.abs(relative)) < median
    assert np.sqrt((relative**2).mean()) < 1e-2


@pytest.mark.long
def test_thirty_iterations_reach_gauss_seidel(room):
    settings = dataclasses.replace(SETTINGS, max_bounces=30, tolerance=0)
    difference, rows = difference_to_gauss_seidel(room, settings)
    assert len(room.patches) == 10700
    assert abs(rows.mean() - 1) < 1e-3
    assert np.abs(rows - 1).max() < 0.01
    assert difference < 0.01


@pytest.mark.long
def test_thirty_iterations_of_wide_hemicubes_reach_gauss_seidel(room):
    settings = dataclasses.replace(SETTINGS, hemicube=64, max_bounces=30, tolerance=0)
    assert difference_to_gauss_seidel(room, settings)[0] < 0.005


def with_black_backs(scene: Scene) -> Scene:
    """Return a scene whose back faces emit like fronts and reflect nothing, as in the reference solver."""
    materials = tuple(
        dataclasses.replace(each, back=BackSide(np.zeros(3, np.float32), each.emission))
        for each in scene.materials
    )
    return dataclasses.replace(scene, materials=materials)


def difference_to_gauss_seidel(room: Prepared, settings: Settings) -> tuple[float, np.ndarray]:
    """Return mean |E - E_gs| relative to the mean E_gs, and the row sums of the form factors."""
    factors = form_factors(room.geometry, room.scene)
    radiance, _ = gauss_seidel(factors, room.emission, room.reflectance)
    expected = gather(factors, radiance, room.emission)
    baked = irradiance(drive(with_black_backs(room.scene), settings))
    return float(np.abs(baked - expected).mean() / expected.mean()), np.abs(factors).sum(axis=1)


@pytest.mark.parametrize("visibility", ["rays", long("raster")])
def test_the_same_input_gives_the_same_bits(visibility):
    settings = Settings(resolution=64, hemicube=16, max_bounces=3, tolerance=0, visibility=visibility)
    first, second = (drive(scenes.sphere(), settings) for _ in range(2))
    assert np.array_equal(first.image, second.image)
    assert np.array_equal(first.display, second.display)


@pytest.mark.long
def test_the_layout_of_the_texture_array_does_not_matter():
    settings = Settings(resolution=64, hemicube=16, max_bounces=2, tolerance=0, visibility="raster")
    tiled = dataclasses.replace(settings, array_size=(256, 192, 4))
    relative = irradiance(drive(scenes.sphere(), tiled)) / irradiance(drive(scenes.sphere(), settings)) - 1
    assert np.median(np.abs(relative)) < 1e-5
    assert np.sqrt((relative**2).mean()) < 1e-3


def test_another_seed_gives_other_rotations():
    settings = Settings(resolution=64, hemicube=16, max_bounces=1)
    other = dataclasses.replace(settings, seed=1)
    assert not np.array_equal(drive(scenes.sphere(), settings).image, drive(scenes.sphere(), other).image)
