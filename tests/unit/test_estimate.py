"""Estimate of texels, memory and time before a bake."""

import pytest

from engine.device.device_info import DeviceInfo, DeviceSurvey
from engine.plan.estimate import estimate
from engine.plan.rates import surveyed_speed
from engine.plan.stages import BakeStages, Extent
from engine.settings import Settings
from tests.analytic.scenes import furnace

SETTINGS = Settings(resolution=97, hemicube=16, samples=256)
EXTENT = Extent(atlases=3, triangles=10_007, lamps=2)


def seconds(patches=9973, settings=SETTINGS, paces=()):
    return estimate(EXTENT, patches, settings, dict(paces)).seconds


def test_extent_is_that_of_the_scene():
    scene = furnace(0.5, 1.0)
    triangles = sum(len(mesh.positions) for mesh in scene.meshes)
    assert Extent.of(scene) == Extent(len(scene.atlases), triangles, len(scene.lights))


def test_more_work_takes_longer():
    assert seconds(20_011) > seconds()
    assert seconds(settings=Settings(resolution=97, hemicube=16, samples=1024)) > seconds()


def test_paces_of_earlier_bakes_count():
    slow = {"Visibility rays": 1e-3, "Visibility raster": 2e-3}
    told = estimate(EXTENT, 9973, SETTINGS, slow)
    assert told.measured and told.seconds > 9973 * 256 * 1e-3
    assert not estimate(EXTENT, 9973, SETTINGS, {"Preparing texels": 1e-9}).measured
    assert slow == {"Visibility rays": 1e-3, "Visibility raster": 2e-3}


@pytest.mark.parametrize(("patches", "size"), [(65_534, 2), (65_535, 4)])
def test_memory_is_that_of_the_samples_and_more(patches, size):
    told = estimate(EXTENT, patches, SETTINGS, {})
    assert told.sample_bytes == patches * 256 * size


def test_estimate_without_bounces_needs_no_samples():
    direct = Settings(resolution=97, outputs=("direct",))
    assert estimate(EXTENT, 9973, direct, {}).sample_bytes == 0


def test_triangles_count_before_and_after_direct_light():
    """Millions of triangles take most of a bake: in the patch list, and in the choice of a method."""
    stages = BakeStages(Extent(1, 12_800_000, 1), SETTINGS, {})
    few = BakeStages(Extent(1, 100, 1), SETTINGS, {})
    for name in ("patches", "choosing"):
        assert getattr(stages, name).seconds_left > 20 * getattr(few, name).seconds_left
    assert few.choosing.seconds_left == pytest.approx(0.06, rel=0.1)


def test_kernels_that_are_not_built_yet_count():
    prepared = estimate(EXTENT, 9973, SETTINGS, {}, preparing=12.5)
    assert prepared.seconds == pytest.approx(seconds() + 12.5)
    assert estimate(EXTENT, 9973, SETTINGS, {}, preparing=float("nan")).seconds == seconds()


def test_rays_by_opengl_on_a_cpu_take_longer():
    alone = DeviceInfo("OpenGL", "llvmpipe (LLVM 19.1.7, 256 bits)", use="casting rays and summing light")
    drawing, compute = (
        DeviceInfo("OpenGL", "llvmpipe", use="drawing"),
        DeviceInfo("OpenCL", "PoCL", use="all"),
    )
    speeds = [surveyed_speed(DeviceSurvey(found)) for found in ((alone,), (compute, drawing), ())]
    assert speeds == [0.25, 1.0, 1.0] and surveyed_speed(None) == 1.0
    assert surveyed_speed(DeviceSurvey((DeviceInfo("OpenGL", "Radeon", use="casting rays"),))) > 100
    slow = estimate(EXTENT, 9973, SETTINGS, {}, speed=0.25).seconds
    assert 2 * seconds() < slow < 4 * seconds()
    known = {"Visibility rays": 1e-3}
    assert estimate(EXTENT, 9973, SETTINGS, known, speed=0.25).seconds < 1.5 * seconds(paces=known)


def test_estimate_is_what_the_stages_of_a_bake_begin_with():
    stages = BakeStages(EXTENT, SETTINGS, {})
    assert stages.estimate_seconds(9973) == pytest.approx(seconds())


def test_samples_with_tints_take_four_bytes():
    tinted = Extent(atlases=3, triangles=10_007, lamps=2, tinted=True)
    plain, larger = (estimate(extent, 9973, SETTINGS, {}) for extent in (EXTENT, tinted))
    assert larger.sample_bytes == 2 * plain.sample_bytes > 0
