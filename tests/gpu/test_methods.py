"""All methods, visibilities and devices give the light of radiance hemicubes drawn anew."""

import dataclasses
import re
import threading
import time

import numpy as np
import pyopencl as cl
import pytest

from engine import DeviceError, Scene, Settings
from engine.device import devices
from engine.device.gl_context import GraphicsContext
from engine.device.host_copy import HostCopy
from engine.gather.glsl_cached import GlslCachedIntegrator
from engine.gather.visibility_cache import BackfaceLight
from engine.patches.patch_scene import make_patch_scene
from engine.plan import choose_solver, visibility_trial
from engine.postprocess import texel_cache
from engine.scene.transmission import CLEAR
from engine.session import Session
from engine.visibility import sample_counts
from engine.visibility.raster.raster_sampler import RasterSampler
from engine.visibility.raster.targets import ItemBufferTarget
from engine.visibility.raster.tiles import Tiles
from engine.visibility.rays.ray_sampler import RaySampler
from engine.visibility.rays.ray_scene import RayScene
from engine.visibility.sampler import upload_background
from tests.analytic.drive import drive
from tests.analytic.scenes import furnace, material, nine_quad_room, quads, rectangle, room_walls
from tests.analytic.test_sky_and_cutouts import sky
from tests.no_compute import NoCompute
from tests.rows import long
from tests.transparency import transparent

SETTINGS = Settings(
    resolution=67, hemicube=8, max_bounces=4, tolerance=0, sample_emission=False,
    accelerate=False, visibility="raster", texel_samples=1,
)  # fmt: skip


def scene(world):
    """Return a room with emission on backs, see-through walls and a sky."""
    room = nine_quad_room()
    changed = [
        dataclasses.replace(
            material,
            transmission=dataclasses.replace(
                transparent(0.7), **({"shadow_back": CLEAR, "bounce_back": CLEAR} if index == 1 else {})
            ),
            emission=material.emission + np.float32(0.1),
        )
        for index, material in enumerate(room.materials)
    ]
    return dataclasses.replace(room, materials=tuple(changed), world=world)


@pytest.fixture(scope="module", params=["even", "map"])
def paper(request):
    """Return a scene and its bake by the paper's method."""
    world = np.float32([1, 2, 3]) if request.param == "even" else sky(32, lambda d: 1 + d[..., 0])
    lightmap = drive(scene(world), dataclasses.replace(SETTINGS, method="paper"))
    assert (lightmap.report.method, lightmap.report.visibility) == ("paper", "raster")
    assert lightmap.image.mean() > 0.5
    return scene(world), lightmap


class OldGraphics(GraphicsContext):
    """OpenGL 4.1: no compute shaders, no draw commands in buffers."""

    def __init__(self):
        super().__init__()
        self.computes = self.indirect = False


@pytest.mark.parametrize("method", ["cached", "stream"])
def test_drawn_identities_give_the_papers_light(paper, method):
    baked = drive(paper[0], dataclasses.replace(SETTINGS, method=method))
    assert (baked.report.method, baked.report.visibility) == (method, "raster")
    assert baked.image == pytest.approx(paper[1].image, rel=2e-5, abs=1e-6)
    assert baked.display == pytest.approx(paper[1].display, rel=2e-5, abs=1e-6)


@pytest.mark.parametrize("method", ["cached", "stream"])
def test_rays_through_hemicube_texels_give_the_papers_light(paper, method):
    """In total: which rays a half-transparent surface stops is chosen by another hash.

    Of eight seeds the ratio of the totals deviates by 0.35 % (standard deviation), its mean by 0.03 %.
    """
    settings = dataclasses.replace(SETTINGS, method=method, visibility="rays", directions="hemicube")
    baked = drive(paper[0], settings)
    assert (baked.report.method, baked.report.visibility) == (method, "rays")
    assert baked.image.sum() == pytest.approx(paper[1].image.sum(), rel=1e-2)
    assert np.median(np.abs(baked.image - paper[1].image)) < 0.1 * paper[1].image.mean()


def test_rays_that_follow_the_cosine_find_the_same_light(paper):
    settings = dataclasses.replace(SETTINGS, visibility="rays", samples=512)
    baked = drive(paper[0], settings)
    assert baked.image.sum() == pytest.approx(paper[1].image.sum(), rel=8e-3)
    assert np.median(np.abs(baked.image - paper[1].image)) < 0.1 * paper[1].image.mean()


@pytest.mark.parametrize("visibility", ["rays", long("raster")])
def test_what_does_not_fit_the_memory_is_streamed(paper, visibility):
    settings = dataclasses.replace(SETTINGS, method="cached", visibility=visibility, memory_budget=1 << 18)
    report = drive(paper[0], settings).report
    assert report.method == "stream" and any("limit is 0 MiB" in reason for reason in report.reasons)


def test_hemicubes_are_drawn_in_whole_batches_however_little_memory_there_is(paper, monkeypatch):
    copies = []
    update = HostCopy.update
    monkeypatch.setattr(HostCopy, "update", lambda self: copies.append(self) or update(self))
    drive(paper[0], dataclasses.replace(SETTINGS, method="stream", memory_budget=1, max_bounces=3))
    assert len(copies) == 3


def test_rays_are_cast_however_slow_they_are(paper, monkeypatch):
    monkeypatch.setattr(visibility_trial, "_patches_per_second", lambda *_: 1e-3)
    report = drive(paper[0], dataclasses.replace(SETTINGS, visibility="auto")).report
    assert report.visibility == "rays" and report.samples == 2 * 8**2


@pytest.mark.parametrize(("seconds", "runs"), [(1e-6, 1), (1.0, 2)])
def test_a_trial_that_is_fast_at_once_is_not_repeated(paper, monkeypatch, seconds, runs):
    """A slow first run may have loaded the kernel, so a second one follows."""
    tried = []
    monkeypatch.setattr(visibility_trial, "_time", lambda *arguments: tried.append(arguments) or seconds)
    report = drive(paper[0], dataclasses.replace(SETTINGS, visibility="auto", max_bounces=1)).report
    assert report.visibility == "rays" and len(tried) == runs


def test_a_bake_waits_for_areas_only_once_visibility_is_computed(monkeypatch):
    """A thread computes them meanwhile."""
    order, find, areas = [], RaySampler.find, texel_cache.surface_areas
    traced = threading.Event()

    def traces(self, *arguments):
        yield from find(self, *arguments)
        order.append("visibility")
        traced.set()

    def measures(*arguments):
        traced.wait(60)
        order.append("areas")
        return areas(*arguments)

    settings = dataclasses.replace(SETTINGS, visibility="rays")
    expected = drive(nine_quad_room(), settings)
    monkeypatch.setattr(RaySampler, "find", traces)
    monkeypatch.setattr(texel_cache, "surface_areas", measures)
    late = drive(nine_quad_room(), settings)
    assert order[:2] == ["visibility", "areas"]
    assert np.array_equal(late.image, expected.image)


def test_a_bake_that_waits_for_areas_can_be_cancelled(monkeypatch):
    """It reports while it waits, so a cancel takes less than half a second."""
    released = threading.Event()
    monkeypatch.setattr(texel_cache, "surface_areas", lambda *arguments: released.wait(20))
    work = Session().bake(nine_quad_room(), dataclasses.replace(SETTINGS, visibility="rays"))
    waiting = (step for step in work if step.stage == "Visibility" and step.fraction == 1)
    try:
        next(waiting)
        began = time.monotonic()
        next(waiting)
        work.close()
        assert time.monotonic() - began < 0.5
    finally:
        released.set()


@pytest.mark.parametrize("visibility", ["rays", long("raster")])
def test_cached_bakes_are_repeatable(visibility):
    world, settings = np.float32([1, 2, 3]), dataclasses.replace(SETTINGS, visibility=visibility)
    first, second = (drive(scene(world), settings).image for _ in range(2))
    assert (first == second).all()


@pytest.mark.parametrize("visibility", ["rays", long("raster")])
def test_ten_accelerated_sweeps_light_a_closed_room(visibility):
    """Reflectance 0.9, to 0.12 %: the paper's iteration takes about 65 sweeps.

    Light between the back of the lamp and the ceiling decays as slowly as that of the room. The step of an
    iteration estimates the light that is missing in both at two thirds: 0.07 % instead of 0.11 % with drawn
    hemicubes, 0.05 % instead of 0.08 % with rays.
    """
    room = nine_quad_room()
    mesh, walls = room.meshes[0], np.isin(room.meshes[0].face, [0, 1, 2, 3, 4, 5, 8])
    names = ("positions", "normals", "uvs", "face", "subface", "material")
    closed = dataclasses.replace(mesh, **{name: getattr(mesh, name)[walls] for name in names})
    bright = [dataclasses.replace(each, reflectance=np.full(3, 0.9, np.float32)) for each in room.materials]
    closed_room = dataclasses.replace(room, meshes=(closed,), materials=tuple(bright))
    settings = dataclasses.replace(
        SETTINGS, visibility=visibility, accelerate=True, max_bounces=50, tolerance=1e-3
    )
    quick = drive(closed_room, settings)
    exact = drive(
        closed_room, dataclasses.replace(settings, accelerate=False, max_bounces=300, tolerance=1e-6)
    )
    has_patch = quick.has_patch
    error = np.abs(quick.image[has_patch] - exact.image[has_patch]).mean() / exact.image[has_patch].mean()
    assert quick.report.iterations <= 10 and quick.report.converged and error < 1.2e-3
    assert exact.report.iterations > 65


@pytest.mark.parametrize("visibility", ["raster", "rays"])
def test_numbers_of_many_patches_take_more_bits(monkeypatch, visibility):
    settings = dataclasses.replace(SETTINGS, visibility=visibility, samples=256)
    few = drive(nine_quad_room(), settings)
    monkeypatch.setattr(sample_counts, "_NARROW", 0)
    many = drive(nine_quad_room(), settings)
    assert (few.image == many.image).all()
    taken = [re.search(r"data needs ([\d,]+) MiB", each.report.reasons[-1])[1] for each in (few, many)]
    assert abs(int(taken[1]) - 2 * int(taken[0])) <= 1


def test_65534_patches_have_numbers_of_16_bits():
    """Beside these there are one for nothing and one for the background."""
    assert (sample_counts.sample_bytes(65534), sample_counts.sample_bytes(65535)) == (2, 4)


def test_rays_and_drawing_find_the_same_patches(graphics, compute):
    """The identity of hemicube texels: a thousandth may differ, and lies on an edge.

    Neighbours on a lightmap count as the same: drivers differ in the last bits of interpolated UVs.
    """
    room = nine_quad_room()
    settings = Settings(resolution=128, hemicube=32, visibility="rays", directions="hemicube")
    patch_scene = make_patch_scene(graphics, compute, room, settings)
    emission, world = patch_scene.surfaces.emission, np.zeros((1, 1, 3), np.float32)
    around = upload_background(compute, emission, world)
    rays = RaySampler(compute, RayScene(compute, patch_scene), patch_scene, around, settings)
    raster = RasterSampler(graphics, compute, patch_scene, around, settings)
    cast, drawn = (find(compute, identity, 3000, 3300, len(emission)) for identity in (rays, raster))
    texels = np.concatenate([[-1000], patch_scene.patches.texel])
    rows, columns = np.abs(np.divmod(texels[cast], 128) - np.array(np.divmod(texels[drawn], 128)))
    differ = (rows > 1) | (columns > 1)
    inner = np.ones_like(differ)
    for image in (cast, drawn):
        for dy, dx in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            inner &= np.roll(image, (dy, dx), (1, 2)) == image
    assert differ.mean() < 1e-3 and not (differ & inner).any()
    assert (drawn > 0).mean() > 0.5


def find(compute, identity, first, last, count):
    """Return what patches first ... last see, (m, 3n, n) uint16."""
    cache = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, identity.row_bytes * (last - first))
    backs = BackfaceLight(compute, count, count, directional=False)
    for _ in identity.find(first, last, backs.found_with(cache, first)):
        pass
    seen = np.empty((last - first, 96, 32), np.uint16)
    cl.enqueue_copy(compute.queue, seen, cache)
    seen[seen > count] = 0
    return seen


@pytest.mark.parametrize("visibility", ["rays", long("raster")])
def test_patch_groups_bring_the_same_light(visibility):
    """A square of 2 x 2 patches is 0.2 m wide in this room; direct and indirect light add up."""
    outputs = ("combined", "direct", "indirect")
    settings = Settings(
        resolution=128, hemicube=16, samples=512, tolerance=1e-3, visibility=visibility, outputs=outputs,
        sample_emission=False, texel_samples=1,
    )  # fmt: skip
    own, grouped = (
        drive(nine_quad_room(), dataclasses.replace(settings, patch_groups=width)) for width in (1, 2)
    )
    has_patch = own.has_patch
    mean = own.image[has_patch].mean()
    difference = (grouped.image - own.image)[has_patch]
    assert abs(difference.mean()) < 3e-3 * mean and np.sqrt((difference**2).mean()) < 0.02 * mean
    assert grouped.passes["direct"] == pytest.approx(own.passes["direct"], abs=1e-4)
    both = grouped.passes["direct"] + grouped.passes["indirect"]
    assert both[has_patch] == pytest.approx(grouped.image[has_patch], abs=1e-5)


def lit_by_panels(resolution):
    """Return a room with panels 3 cm below its ceiling, which is bright behind them; where its floor is."""
    panels = [rectangle((x, y, 1.97), (-0.4, 0, 0), (0, 0.4, 0)) for x in (0.7, 1.6) for y in (0.3, 1.3)]
    charts = [(22 * (k % 3), 22 * (k // 3), 20, 20) for k in range(6)] + [(6 * k, 44, 4, 4) for k in range(4)]
    corners, materials = np.stack([*room_walls(2, 2, 2), *panels]), [0] * 6 + [1] * 4
    scene = Scene(
        (quads(corners, charts, materials, resolution),),
        (material("White", 0.6), material("Light", 0.6, 10.0)),
    )
    return scene, np.s_[:, 0:20, 0:20]


def test_light_that_nobody_sees_stays_out_of_groups():
    scene, floor = lit_by_panels(64)
    settings = Settings(
        resolution=64, samples=1024, visibility="rays", outputs=("combined", "direct", "indirect"),
        texel_samples=1, hide_seams=False,
    )  # fmt: skip
    own, grouped = (
        drive(scene, dataclasses.replace(settings, patch_groups=width)).passes["indirect"][floor]
        for width in (1, 4)
    )
    assert grouped.mean() == pytest.approx(own.mean(), rel=0.01)


def test_short_memory_groups_patches():
    settings = Settings(resolution=128, samples=256, visibility="rays", memory_budget=4 << 20)
    report = drive(nine_quad_room(), settings).report
    assert report.method == "cached" and "are solved as one" in report.reasons[0]


def test_opengl_and_opencl_sum_alike(paper, monkeypatch):
    monkeypatch.setattr(devices, "GraphicsContext", OldGraphics)
    in_cl = drive(paper[0], dataclasses.replace(SETTINGS, method="paper"))
    assert (paper[1].report.integrator, in_cl.report.integrator) == ("glsl", "opencl")
    assert paper[1].image == pytest.approx(in_cl.image, rel=2e-5, abs=1e-6)
    assert paper[1].display == pytest.approx(in_cl.display, rel=2e-5, abs=1e-6)


@pytest.mark.long
def test_half_floats_are_for_opengl_alone(paper, monkeypatch):
    half = dataclasses.replace(SETTINGS, method="paper", half_radiance=True)
    rough = drive(paper[0], half).image
    assert rough == pytest.approx(paper[1].image, rel=2e-3, abs=1e-5) and (rough != paper[1].image).any()
    monkeypatch.setattr(devices, "GraphicsContext", OldGraphics)
    assert drive(paper[0], half).image == pytest.approx(paper[1].image, rel=2e-5, abs=1e-6)


@pytest.mark.parametrize("method", ["paper", "cached"])
def test_later_sweeps_leave_direct_light_alone(method):
    """Backs of panels reflect bounced light alone: some texels beside them are valid after later sweeps only.

    Invalid texels are filled from others, and smoothed seams would spread the difference.
    """
    outputs = ("direct", "indirect")
    settings = dataclasses.replace(
        SETTINGS, method=method, outputs=outputs, tolerance=0, accelerate=False, hide_seams=False
    )
    once, often = (
        drive(nine_quad_room(), dataclasses.replace(settings, max_bounces=count)) for count in (1, 9)
    )
    both = once.known & often.known
    assert both.sum() >= 0.998 * once.has_patch.sum() and often.known[once.known].all()
    assert (often.passes["direct"][both] == once.passes["direct"][both]).all()
    assert often.passes["indirect"].sum() > 0


def test_memory_that_is_not_enough_is_a_clear_error(monkeypatch):
    def full(*arguments):
        raise cl.MemoryError("MEM_OBJECT_ALLOCATION_FAILURE")

    monkeypatch.setattr(choose_solver, "DeviceRadiosity", full)
    with pytest.raises(DeviceError, match="GiB of .* not enough.*Lower the resolution"):
        drive(nine_quad_room(), dataclasses.replace(SETTINGS, visibility="rays"))


def test_a_machine_without_opencl_gives_the_same_light(paper, monkeypatch):
    monkeypatch.setattr(devices, "ComputeDevice", NoCompute)
    alone = drive(paper[0], dataclasses.replace(SETTINGS, visibility="raster"))
    assert (alone.report.method, alone.report.integrator) == ("cached", "glsl")
    assert set(alone.report.devices) == {"gl"} and "without OpenCL" in alone.report.warnings[0]
    assert alone.image == pytest.approx(paper[1].image, rel=2e-5, abs=1e-6)


def test_neither_opencl_nor_compute_shaders_is_a_clear_error(monkeypatch):
    monkeypatch.setattr(devices, "ComputeDevice", NoCompute)
    monkeypatch.setattr(devices, "GraphicsContext", OldGraphics)
    with pytest.raises(DeviceError, match="no OpenGL 4.3, so OpenCL is needed.*Install"):
        drive(scene(np.float32([1, 2, 3])), SETTINGS)


def test_a_batch_larger_than_a_storage_block_is_kept_in_parts(graphics, monkeypatch):
    """Hemicubes whose texels all see one patch gather just its radiance."""
    tiles, count = Tiles(8, 3, 1, 4), 11
    target = ItemBufferTarget(graphics, tiles)
    seen = np.ones((tiles.layers, tiles.height, tiles.width), np.uint32)
    target.texture.write(seen.tobytes())
    monkeypatch.setitem(graphics.context.info, "GL_MAX_SHADER_STORAGE_BLOCK_SIZE", 4 * 4 * 192)
    dark = np.zeros((1, 3), np.float32)
    cache = GlslCachedIntegrator(graphics, tiles, target.texture, dark, dark[None])
    cache.keep(np.tile(np.float32([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1]]), (count, 1, 1)))
    cache.set_radiance(np.float32([[1, 2, 3]]))
    assert cache.gather(0) == pytest.approx(np.tile([1, 2, 3, 1], (count, 1)), rel=1e-6)
    assert cache.batches == 1


def test_flux_of_bright_light_on_large_areas_is_a_number():
    """In W it leaves float32, which the device sums in."""
    room = furnace(0.5, 1e29)
    (mesh,) = room.meshes
    large = dataclasses.replace(
        room, meshes=(dataclasses.replace(mesh, positions=mesh.positions * np.float32(1e5)),)
    )
    baked = drive(large, Settings(resolution=16, hemicube=8))
    assert baked.image[baked.has_patch] == pytest.approx(2e29, rel=0.01)
    area = 6 * float(np.ptp(large.meshes[0].positions)) ** 2
    assert sum(baked.report.added_flux) == pytest.approx(3 * np.pi * area * 0.5 * 2e29, rel=0.05)
