"""Direct light by compute shaders is that of OpenCL from the same samples: each kind of light."""

from dataclasses import replace

import numpy as np
import pyopencl as cl
import pytest

from engine import Settings, finished
from engine.device.cl_device import ComputeDevice
from engine.direct.emitter_split import split_light
from engine.direct.shader_shadow_rays import ShaderShadowRays
from engine.direct.shadow_rays import ShadowRays
from engine.patches.backs import with_places
from engine.patches.patch_scene import make_patch_scene
from engine.scene.light_groups import light_groups
from engine.scene.model import shining_lights
from engine.scene.open_surfaces import OpenSurfaces
from engine.scene.profile import Profile
from engine.scene.transmission import Transmission, Transmittance
from engine.visibility.rays.ray_scene import RayScene
from engine.visibility.rays.ray_tracer import SOURCE, RayTracer
from engine.visibility.rays.receiver_records import RECEIVER, pack_receivers
from engine.visibility.rays.shaders.host_receivers import receivers_on_host
from engine.visibility.rays.shaders.shader_scene import ShaderScene
from tests.analytic import scenes
from tests.gpu.test_stale_shadows import lamp, lit

SETTINGS = Settings(
    resolution=31, hemicube=8, samples=16, light_samples=11, ao_samples=13,
    outputs=("directional", "ambient_occlusion", "shadow_mask"), sample_emission=True,
)  # fmt: skip

PROFILE = Profile(
    np.linspace(0, 2 * np.pi, 5, dtype=np.float32),
    np.linspace(0, 2.5, 7, dtype=np.float32),
    np.random.default_rng(3).random((5, 7, 3)).astype(np.float32) + 0.1,
)

SKY = np.full((7, 13, 3), 0.1, np.float32)
SKY[5, 3] = 300, 200, 100

GLASS = Transmission(*2 * [Transmittance(offset=np.float32([0.9, 0.5, 0.2]))])


def through_glass(scene):
    """Return a scene whose last mesh is of tinted glass."""
    number = int(scene.meshes[-1].material[0])
    materials = list(scene.materials)
    materials[number] = replace(materials[number], transmission=GLASS)
    return replace(scene, materials=tuple(materials))


SCENES = {
    "point": lambda: lit(0.0, lamp("point", radius=0.07)),
    "sphere": lambda: lit(0.0, lamp("point", radius=0.3, soft=False)),
    "spot": lambda: lit(0.0, lamp("spot", half_angle=0.7, blend=0.2, stretch=np.array([1, 0.6, 1.1]))),
    "sun": lambda: lit(0.0, lamp("sun", half_angle=0.05)),
    "rectangle": lambda: lit(0.0, lamp("area", size=np.array([0.7, 0.3]))),
    "ellipse": lambda: lit(0.0, lamp("area", size=np.array([0.7, 0.3]), ellipse=True)),
    "spread": lambda: lit(0.0, lamp("area", size=np.array([0.7, 0.3]), half_angle=0.8)),
    "profile": lambda: lit(0.0, lamp("point", profile=PROFILE, falloff_power=1, falloff_smooth=0.3)),
    "surface": lambda: lit(0.0, emits=2),
    "sky": lambda: lit(0.0, world=SKY),
    "far": lambda: lit(2000.0, lamp("point", radius=0.3), lamp("sun", casts_shadow=False)),
    "glass": lambda: through_glass(lit(0.0, lamp("point", radius=0.02), emits=2)),
    "many": lambda: lit(0.0, lamp("point"), lamp("sun"), lamp("area", size=np.ones(2)), world=SKY, emits=1),
}  # fmt: skip


@pytest.fixture(scope="module")
def opencl():
    """The OpenCL device; graphics cards need no tests of their own."""
    return ComputeDevice()


@pytest.fixture(scope="module")
def made(graphics):
    """Return patches of each scene once, and its rays in shaders."""
    known = {}

    def make(name):
        if name not in known:
            scene = with_places(SCENES[name](), SETTINGS.resolution, OpenSurfaces())
            patch_scene = make_patch_scene(graphics, None, scene, SETTINGS)
            known[name] = scene, patch_scene, ShaderScene(graphics, patch_scene)
        return known[name]

    return make


def casters(compute, made, name):
    """Return both casters of a scene: shaders, then OpenCL."""
    scene, patch_scene, shaders = made(name)
    split = split_light(scene.world, patch_scene, SETTINGS)
    lamps = [light.relative_to(patch_scene.triangles.origin) for light in shining_lights(scene)]
    rest = patch_scene, lamps, split.bright, split.sky, SETTINGS
    return ShaderShadowRays(shaders, *rest), ShadowRays(RayScene(compute, patch_scene), *rest)


def differences(ours, theirs):
    """Return the mean difference over the mean, and the part of values that differ by over 1e-3 of it."""
    scale = max(float(np.abs(theirs).mean()), 1e-20)
    off = np.abs(ours - theirs) / scale
    return float(off.mean()), float((off > 1e-3).mean())


@pytest.mark.parametrize("name", SCENES)
def test_light_is_that_of_opencl(opencl, made, name):
    ours, theirs = (finished(caster.sampled()) for caster in casters(opencl, made, name))
    assert theirs[0].any()
    for mine, other in zip(ours, theirs, strict=True):
        mean, part = differences(mine, other)
        assert mean < 1e-3
        assert part < 0.03


def test_work_of_many_steps_goes_on_in_several_dispatches(opencl, made, monkeypatch):
    """Mesa's llvmpipe ends loops after 65,535 steps of an invocation."""
    monkeypatch.setitem(SCENES, "long", SCENES["many"])
    scene, patch_scene, shaders = made("long")
    split = split_light(scene.world, patch_scene, SETTINGS)
    lamps = [light.relative_to(patch_scene.triangles.origin) for light in shining_lights(scene)]
    rest = patch_scene, lamps, split.bright, split.sky, replace(SETTINGS, light_samples=97, ao_samples=1009)
    pair = ShaderShadowRays(shaders, *rest), ShadowRays(RayScene(opencl, patch_scene), *rest)
    for ours, theirs in (
        [finished(caster.sampled())[0] for caster in pair],
        [finished(caster.ambient_occlusion()) for caster in pair],
    ):
        assert differences(ours, theirs)[0] < 1e-3


def test_masks_occlusion_and_light_groups_are_those_of_opencl(opencl, made):
    pair = casters(opencl, made, "many")
    scene = made("many")[0]
    groups = replace(light_groups(scene), count=1)
    for ours, theirs in (
        [finished(caster.shadow_mask(1)) for caster in pair],
        [finished(caster.ambient_occlusion()) for caster in pair],
        [finished(caster.sampled_by_group(groups)) for caster in pair],
    ):
        assert ours.shape == theirs.shape
        assert theirs.mean() > 0.05
        assert differences(ours, theirs)[0] < 1e-3


def test_records_of_receivers_are_those_of_opencl(graphics, opencl):
    scene = replace(scenes.sphere(), meshes=scenes.sphere().meshes)
    patch_scene = make_patch_scene(graphics, None, scene, replace(SETTINGS, resolution=64))
    mine = receivers_on_host(patch_scene.patches, patch_scene.geometry)
    (pack,) = RayTracer(opencl, patch_scene.triangles, patch_scene.cutouts).kernels(SOURCE, "pack_receivers")
    buffer = pack_receivers(opencl, pack, patch_scene.patches, patch_scene.geometry)
    theirs = np.zeros(len(mine), RECEIVER.dtype)
    cl.enqueue_copy(opencl.queue, theirs, buffer)
    assert (mine["rank"] == theirs["rank"]).all()
    for name in ("at", "height", "normal", "geometric", "edge1", "normal3"):
        assert mine[name] == pytest.approx(theirs[name], rel=1e-5, abs=1e-6)
