"""The fit, rings and membrane of the OpenCL device are those of NumPy."""

from functools import partial
from itertools import pairwise

import numpy as np
import pyopencl as cl
import pytest

from benchmarks.device_log import LAUNCH, DeviceLog
from engine.device.buffers import download, upload, upload_float4
from engine.device.cl_device import ComputeDevice
from engine.direct.contact import Contacts
from engine.patches.patch_list import PatchList
from engine.patches.seams import Seams, no_seams
from engine.postprocess import device_bilinear_fit, device_images
from engine.postprocess.bilinear import footprints
from engine.postprocess.device_bilinear_equations import DeviceBilinearEquations
from engine.postprocess.device_bilinear_fit import DeviceBilinearFit
from engine.postprocess.device_final_images import DeviceFinalImages
from engine.postprocess.device_images import texels_of
from engine.postprocess.final_images import FinalImages
from engine.postprocess.final_lightmaps import FinalLightmaps
from engine.postprocess.lightmap_points import LightmapPoints, off_centre_patches
from engine.postprocess.refined_texels import RefinedTexels
from engine.postprocess.store import LightmapImages
from engine.postprocess.texel_means import TexelMeans
from engine.postprocess.texel_samples import TexelSamples
from tests.gpu.test_texel_fragments import triangles_of
from tests.seams import find_seams
from tests.unit.test_bilinear_fit import NO_SEAMS, covered, points_at, shown, step
from tests.unit.test_near_charts import all_over, images_of, near_charts
from tests.unit.test_seams import R, cylinder, joined, tile

NO_POINTS = points_at(np.zeros((0, 2)))


def ordered(points):
    """Return points in the order of their texels."""
    return points.subset(np.argsort(points.texels(R), kind="stable"))


def lit(case, seed):
    """Return light of texels and of points, in a random range: dark, bright, or of both signs."""
    random = np.random.default_rng(seed)
    centres, beside, *_ = case
    channels = int(random.choice([1, 3]))
    scale = random.choice([1e-6, 1.0, 1e22])
    light = random.lognormal(0, 1, (centres.size + len(beside), channels)) * scale
    light[:, -1] -= random.choice([0.0, 1.0]) * scale
    light = light.astype(np.float32)
    return light[: centres.size].reshape(*centres.shape, channels), light[centres.size :]


def both(compute, case, texels, values):
    """Return the images that the device and NumPy make.

    Where a run ends before it has settled, as in texels that points hardly read, float32 may differ.
    """
    made = DeviceFinalImages(compute, *case).images(texels, values)
    return made, FinalImages(*case).images(texels, values)


def strips(seed):
    """Return tiles beside each other, in two atlases, some patches gone, with points anywhere."""
    random = np.random.default_rng(seed)
    cuts = np.sort(random.integers(0, R + 1, 6))
    parts = [
        tile(
            (u, 0), (v - u, random.uniform(9, 60)), (u, 0, v - u, R), int(random.integers(2)),
            turned=bool(random.integers(2)),
        )
        for u, v in pairwise(cuts)
        if v > u
    ]  # fmt: skip
    triangles = joined(*parts)
    has_patch, _ = covered(triangles, 2)
    centres = has_patch & (random.random(has_patch.shape) < 0.8)
    positions = random.uniform(0, R, (90, 2))
    beside = points_at(positions, random.integers(2, size=90), 0.3)
    beside = ordered(LightmapPoints(beside.atlas, beside.position, random.uniform(0.05, 1, 90)))
    centres.ravel()[beside.texels(R)] = False
    return centres, beside, find_seams(triangles, 2, R), has_patch, int(random.choice([0, 1, 2, 7]))


@pytest.mark.parametrize("seed", range(8))
def test_images_are_those_of_numpy(compute: ComputeDevice, seed: int) -> None:
    case = strips(seed)
    texels, values = lit(case, seed)
    made, expected = both(compute, case, texels, values)
    scale = max(np.abs(texels).max(), np.abs(values).max())
    assert np.isfinite(made).all() and (made[~case[3]] != 0).any() == (expected[~case[3]] != 0).any()
    assert np.quantile(np.abs(made - expected), 0.999) < 0.01 * scale
    assert np.abs(made - expected).mean() < 1e-3 * np.abs(expected).mean()


def test_cylinder_has_no_step_and_texels_inside_keep_their_bits(compute: ComputeDevice) -> None:
    triangles = joined(cylinder(17))
    has_patch, world = covered(triangles, 1)
    seams = find_seams(triangles, 1, R)
    texels = np.zeros((1, R, R, 3), np.float32)
    texels[has_patch] = 2 + world[:, :1] + 1.5 * world[:, 1:2] * world[:, 2:]
    case = has_patch, NO_POINTS, seams, has_patch, 8
    made, expected = both(compute, case, texels, np.zeros((0, 3), np.float32))
    np.testing.assert_allclose(made, expected, atol=2e-3)
    sides = []
    for side in (0, 1):
        read, weights = footprints(seams.atlas[:, side], seams.texel[:, side], R)
        sides.append(np.einsum("pk,pkc->pc", weights, made.reshape(-1, 3)[read]))
    assert np.abs(sides[0] - sides[1]).mean() < 2e-3
    same = made[has_patch] == texels[has_patch]
    assert same.all(axis=1).mean() > 0.7


@pytest.mark.parametrize(("gap", "offset"), [(2, 0), (2, 0.6), (2.3, 0.3)])
def test_seam_is_not_seen_on_a_chart_beside_it(compute: ComputeDevice, gap: float, offset: float) -> None:
    triangles, chart = near_charts(gap, offset)
    _, fitted, seams = images_of(partial(DeviceFinalImages, compute), triangles)
    np.testing.assert_allclose(shown(fitted, 0, all_over(chart)), 0.2, rtol=0.005)
    assert step(fitted, seams) < 1e-3


def test_bake_after_bake_gives_the_same_bits(compute: ComputeDevice) -> None:
    case = strips(3)
    texels, values = lit(case, 3)
    images = [DeviceFinalImages(compute, *case).images(texels, values) for _ in range(2)]
    assert (images[0].view(np.uint32) == images[1].view(np.uint32)).all()


@pytest.mark.parametrize("seed", [0, 3, 5])
@pytest.mark.parametrize("before", [0x00, 0x7F, 0xFF])
def test_what_memory_held_before_does_not_matter(
    compute: ComputeDevice, monkeypatch: pytest.MonkeyPatch, seed: int, before: int
) -> None:
    """Bytes 0xFF are NaN."""
    case = strips(seed)
    texels, values = lit(case, seed)
    expected = DeviceFinalImages(compute, *case).images(texels, values)
    used = []

    def full(fit: DeviceBilinearFit, size: int) -> cl.Buffer:
        used.append(size)
        return upload(compute, np.full(size, before, np.uint8))

    monkeypatch.setattr(DeviceBilinearFit, "_buffer", full)
    made = DeviceFinalImages(compute, *case).images(texels, values)
    assert len(used) >= 11 and (made.view(np.uint32) == expected.view(np.uint32)).all()


def test_nothing_known_stays_black_and_nothing_to_fit_keeps_its_bits(compute: ComputeDevice) -> None:
    has_patch = np.random.default_rng(1).random((2, 13, 13)) < 0.4
    texels = np.random.default_rng(2).random((2, 13, 13, 3)).astype(np.float32)
    none = np.zeros((0, 3), np.float32)
    nothing = np.zeros_like(has_patch), NO_POINTS, NO_SEAMS, has_patch, 3
    assert not DeviceFinalImages(compute, *nothing).images(texels, none).any()
    made, expected = both(compute, (has_patch, NO_POINTS, NO_SEAMS, has_patch, 3), texels, none)
    assert (made[has_patch].view(np.uint32) == texels[has_patch].view(np.uint32)).all()
    np.testing.assert_allclose(made, expected, rtol=1e-5, atol=1e-6)


def test_a_seam_that_no_point_tells_about_is_none(compute: ComputeDevice) -> None:
    has_patch = np.zeros((1, R, R), bool)
    has_patch[:, 20:40, 4:60] = True
    centres = has_patch.copy()
    centres[:, :, 30:] = False
    texel = np.array([[[50.5, 25.3], [55.2, 30.1]], [[10.4, 22.2], [56.0, 31.7]]])
    seams = Seams(np.zeros((2, 2), np.int32), texel, np.ones(2))
    texels = np.random.default_rng(5).random((1, R, R, 1)).astype(np.float32)
    case = centres, NO_POINTS, seams, has_patch, 4
    made, expected = both(compute, case, texels, np.zeros((0, 1), np.float32))
    np.testing.assert_allclose(made, expected, atol=2e-3)


def test_thin_patches_are_those_of_numpy(compute: ComputeDevice) -> None:
    random = np.random.default_rng(4)
    uvs = random.random((40, 3, 2))
    triangles = triangles_of(uvs)
    triangle = random.integers(40, size=500).astype(np.int32)
    barycentric = random.dirichlet((1, 1, 1), 500).astype(np.float32)
    at = np.einsum("nk,nkd->nd", barycentric, triangles.uvs[triangle].astype(float)) * R
    column, row = np.floor(at).astype(np.int32).T
    patches = PatchList(R, np.zeros(500, np.int32), row * R + column, triangle, barycentric)
    distance = np.abs(at % 1 - 0.5).max(axis=1)
    clear = np.abs(distance - 0.02) > 1e-3
    number, points = off_centre_patches(compute, triangles, patches)
    assert set(np.flatnonzero((distance > 0.02) & clear)) == set(number[clear[number]])
    np.testing.assert_allclose(points.position, at[number], atol=1e-4)


@pytest.mark.parametrize("channels", [1, 3])
def test_store_makes_the_same_images_with_and_without_opencl(compute: ComputeDevice, channels: int) -> None:
    """Patches of two atlases, some hidden, some dark, and some of occluders in a third one."""
    random = np.random.default_rng(channels)
    resolution, shape = 17, (3, 17, 17)
    atlas, texel = np.divmod(np.flatnonzero(random.random(shape) < 0.3), resolution**2)
    count = len(atlas)
    patches = PatchList(
        resolution, atlas.astype(np.int32), texel.astype(np.int32), np.zeros(count, np.int32),
        np.full((count, 3), 1 / 3, np.float32),
    )  # fmt: skip
    values = random.random((count, 4)).astype(np.float32)[:, :channels]
    near = Contacts(random.random(count) < 0.1, *np.zeros((2, count), bool))
    front = np.where(random.random(count) < 0.2, 0, 1).astype(np.float32)
    stores = [LightmapImages(patches, 2, 3, device) for device in (None, compute)]
    for store in stores:
        before = store.display(values)
        store.hide(front, near)
        assert (store.display(values) != before).any()
    expected, made = stores
    assert (expected.image(values) == made.image(values)).all()
    np.testing.assert_allclose(made.display(values), expected.display(values), rtol=1e-6)
    texels = RefinedTexels(expected).values(values, None)
    assert (RefinedTexels(made).values(values, None) == texels).all() and texels.shape[-1] == channels
    host, final = (FinalLightmaps(RefinedTexels(store)) for store in stores)
    np.testing.assert_allclose(final.image(texels), host.image(texels), rtol=1e-6)
    together = final.images({"some": values, "double": 2 * values}, {})
    assert list(together) == ["some", "double"] and (together["some"] == final.image(texels)).all()
    assert (together["double"] == final.image(2 * texels)).all()


def test_the_host_makes_previews_while_programs_of_a_cpu_are_built(
    compute: ComputeDevice, monkeypatch
) -> None:
    random = np.random.default_rng(3)
    atlas, texel = np.divmod(np.flatnonzero(random.random(3 * 17**2) < 0.3), 17**2)
    patches = PatchList(
        17, atlas.astype(np.int32), texel.astype(np.int32), np.zeros(len(atlas), np.int32),
        np.full((len(atlas), 3), 1 / 3, np.float32),
    )  # fmt: skip
    values = random.random((len(atlas), 3)).astype(np.float32)
    host, device = (LightmapImages(patches, 2, 3, opened) for opened in (None, compute))
    monkeypatch.setattr(ComputeDevice, "is_preparing", True)
    assert (device.display(values) == host.display(values)).all()
    assert device._fill is None and device._device is None


@pytest.mark.parametrize("channels", [1, 3])
def test_means_of_samples_are_put_in_texels_on_the_device(compute: ComputeDevice, channels: int) -> None:
    """Texels of two atlases, some without a patch, some with samples, some of which nobody sees."""
    random = np.random.default_rng(channels)
    resolution = 19
    texel = np.flatnonzero(random.random(resolution**2) < 0.5).astype(np.int32)
    count = len(texel)
    middle, none = np.full((count, 3), 1 / 3, np.float32), np.zeros(count, np.int32)
    patches = PatchList(resolution, none, texel, none, middle)
    store = LightmapImages(patches, 2, 2, compute)
    chosen = np.sort(random.integers(2 * resolution**2, size=131))
    atlas, shows = (part.astype(np.int32) for part in np.divmod(chosen, resolution**2))
    weight = random.random(131).astype(np.float32)
    position, corners = np.zeros((131, 2), np.float32), np.zeros((131, 3), np.float32)
    samples = TexelSamples(atlas, shows, position, weight, np.zeros(131, np.int32), corners)
    means = TexelMeans(compute, samples, random.random(131) < 0.8, (2, resolution, resolution))
    refined = RefinedTexels(store, means, random.random(count) < 0.1)
    values, light = (random.normal(size=(n, channels)).astype(np.float32) for n in (count, 131))
    final = FinalLightmaps(refined)
    made = final.images({"combined": values}, {"combined": light})["combined"]
    assert (made == final.image(refined.values(values, light))).all()


def test_no_texels_are_read_and_none_are_put(compute: ComputeDevice) -> None:
    """As beside a thin wall all of whose texels have samples."""
    texels, nothing = texels_of(compute, np.ones((1, 5, 5, 3), np.float32)), np.zeros(0, np.int64)
    assert texels.rows(nothing).shape == (0, 3)
    texels.put_rows(nothing, np.zeros((0, 3), np.float32))
    assert (texels.rows(np.arange(25)) == 1).all()


@pytest.mark.parametrize("tight", [False, True])
def test_tight_texels_are_no_brighter_than_the_points_in_them(compute: ComputeDevice, tight: bool) -> None:
    """Light rises steeply to the right; points are left of the centres of 7 x 5 texels."""
    resolution, random = 11, np.random.default_rng(5)
    row, column = (axis.repeat(4) for axis in np.divmod(np.arange(35), 7))
    position = np.stack([column + random.uniform(0.05, 0.45, 140), row + random.random(140)], axis=1)
    light = np.exp(1.5 * position[:, 0]).astype(np.float32)
    points = LightmapPoints(np.ones(140, np.int32), position, np.full(140, 0.25))
    equations = DeviceBilinearEquations(
        compute, np.zeros((2, resolution, resolution), bool), points, no_seams()
    )
    colors = np.stack([light, 0 * light, -light], axis=1)
    fit = DeviceBilinearFit(compute, equations, tight)
    shown = fit.unknowns(upload_float4(compute, colors), float(light.max()))
    owner = np.searchsorted(equations.texel, points.texels(resolution))
    brightest = np.maximum.reduceat(light, np.arange(0, 140, 4))
    over = shown[owner[::4], 0] > 1.03 * brightest
    assert over.sum() > 10 if not tight else not over.any()
    assert not shown[:, 1].any()


def test_every_texel_has_the_points_in_it(compute: ComputeDevice) -> None:
    """Up to nine a texel, so that one work item begins the range of a texel and another one ends it."""
    resolution, random = 97, np.random.default_rng(7)
    texels = np.sort(random.choice(resolution**2, 5003, replace=False))
    owner = np.repeat(texels, random.integers(1, 10, len(texels)))
    corner = np.stack([owner % resolution, owner // resolution], axis=1)
    position = corner + random.uniform(0.01, 0.99, (len(owner), 2))
    points = LightmapPoints(np.zeros(len(owner), np.int32), position, np.ones(len(owner)))
    equations = DeviceBilinearEquations(
        compute, np.zeros((1, resolution, resolution), bool), points, no_seams()
    )
    ranges = download(compute, equations.ranges, (equations.count, 2)).view(np.int32)
    first, last = (np.searchsorted(owner, equations.texel, side) for side in ("left", "right"))
    has_points = first < last
    assert (ranges[has_points] == np.stack([first, last], axis=1)[has_points]).all()
    assert not ranges[~has_points].any()


@pytest.mark.parametrize("memory", [1, 1 << 28])
def test_outputs_that_are_made_together_have_the_bits_of_each_alone(
    compute: ComputeDevice, monkeypatch: pytest.MonkeyPatch, memory: int
) -> None:
    """Outputs of other ranges settle after other numbers of steps; also of one channel, and of both signs."""
    monkeypatch.setattr(device_images, "_MEMORY", memory)
    case, random = strips(5), np.random.default_rng(11)
    centres, beside, *_ = case
    display = DeviceFinalImages(compute, *case)
    shown, light = [], []
    for scale, channels in ((1.0, 3), (1e-6, 3), (1e22, 1), (1.0, 3), (0.0, 3)):
        texels = scale * random.normal(size=(*centres.shape, channels)).astype(np.float32)
        values = scale * random.normal(size=(len(beside), channels)).astype(np.float32)
        shown.append(texels), light.append(values)
    alone = np.array([display.images(*pair) for pair in zip(shown, light, strict=True)])
    together = DeviceFinalImages(compute, *case)
    made = []
    for first in range(0, len(shown), together.most):
        some = slice(first, first + together.most)
        outputs = [texels_of(compute, texels) for texels in shown[some]]
        for texels, values in zip(outputs, light[some], strict=True):
            points = upload_float4(compute, np.broadcast_to(values, (len(values), 3)))
            texels.shown_with(points, len(values))
        points = np.concatenate([np.broadcast_to(values, (len(values), 3)) for values in light[some]])
        made += list(together.images_of(outputs, upload_float4(compute, points)))
    assert (
        len(made) == len(alone)
        and (np.array(made) == alone).all()
        and alone.any(axis=(1, 2, 3, 4)).sum() == 4
    )


@pytest.mark.parametrize("seed", [0, 3, 5])
def test_one_work_group_makes_the_bits_of_many_launches(
    compute: ComputeDevice, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """Systems of a few hundred unknowns with seams: images of which one has no light."""
    case = strips(seed)
    texels, values = lit(case, seed)
    monkeypatch.setattr(device_bilinear_fit, "_SMALL", 1024)
    display = DeviceFinalImages(compute, *case)
    assert display._fit is not None and display._fit._is_small and display._fit._count > 64
    at_once = display.images(texels, values)
    monkeypatch.setattr(device_bilinear_fit, "_SMALL", 0)
    launched = DeviceFinalImages(compute, *case).images(texels, values)
    assert at_once.any() and (at_once == launched).all()


def test_a_step_of_the_fit_takes_three_launches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both runs take all their steps here: 4 launches to begin, and 3 a step but 2 in the last."""
    monkeypatch.setattr(device_bilinear_fit, "_SMALL", 0)
    monkeypatch.setattr(device_bilinear_fit.DeviceBilinearFit, "_done", lambda *_: False)
    case, log = strips(0), DeviceLog()
    with log.logging():
        display = DeviceFinalImages(ComputeDevice(), *case)
        log.clear()
        display.images(*lit(case, 0))
    names = "differences", "begin_run", "begin_steps", "cg_curvature", "advance", "cg_direction"
    assert sum(entry.name in names for entry in log.entries if entry.kind == LAUNCH) == 2 * 4 + 26 * 3 - 2
