"""All ways to gather give the same light: radiance drawn anew or identities kept, in OpenGL or OpenCL."""

import dataclasses
from importlib import import_module

import numpy as np
import pytest

from engine import DeviceError, Light, Settings, without_opencl
from engine.device.graphics import Graphics
from engine.integrate.glsl_cached import GlslCachedIntegrator
from engine.visibility.targets import IdentityTarget
from engine.visibility.tiles import Tiles
from tests.analytic.drive import drive
from tests.analytic.scenes import nine_quad_room
from tests.analytic.test_sky_and_cutouts import sky

SETTINGS = Settings(resolution=128, hemicube=8, iterations=4, tolerance=0, sample_emission=False)


def scene(world):
    """Return a room with emission on backs, see-through walls and a sky."""
    room = nine_quad_room()
    changed = [
        dataclasses.replace(
            material, alpha=0.7, culled=index == 1, emission=material.emission + np.float32(0.1)
        )
        for index, material in enumerate(room.materials)
    ]
    return dataclasses.replace(room, materials=tuple(changed), world=world)


WORLDS = pytest.mark.parametrize(
    "world", [np.float32([1, 2, 3]), sky(32, lambda d: 1 + d[..., 0])], ids=["even", "map"]
)


class NoCompute:
    """Stands in for OpenCL on a machine that has none."""

    def __init__(self, cache_dir=None):
        raise DeviceError("There is no OpenCL device. Install one.")


class OldGraphics(Graphics):
    """OpenGL 4.1: no compute shaders, no draw commands in buffers."""

    def __init__(self):
        super().__init__()
        self.computes = self.indirect = False


@WORLDS
def test_methods_agree(world):
    lightmaps = [
        drive(scene(world), dataclasses.replace(SETTINGS, method=method)) for method in ("paper", "cached")
    ]
    paper, cached = lightmaps
    assert [lightmap.report.method for lightmap in lightmaps] == ["paper", "cached"]
    assert cached.image == pytest.approx(paper.image, rel=2e-5, abs=1e-6)
    assert cached.display == pytest.approx(paper.display, rel=2e-5, abs=1e-6)
    assert paper.image.mean() > 0.5


def test_cached_bakes_are_repeatable():
    world = np.float32([1, 2, 3])
    first, second = (drive(scene(world), SETTINGS).image for _ in range(2))
    assert (first == second).all()


@WORLDS
def test_opengl_and_opencl_sum_alike(world, monkeypatch):
    settings = dataclasses.replace(SETTINGS, method="paper", iterations=1)
    in_gl = drive(scene(world), settings)
    monkeypatch.setattr(import_module("engine.bake"), "Graphics", OldGraphics)
    in_cl = drive(scene(world), settings)
    assert (in_gl.report.integrator, in_cl.report.integrator) == ("glsl", "opencl")
    assert in_gl.image == pytest.approx(in_cl.image, rel=2e-5, abs=1e-6)
    assert in_gl.display == pytest.approx(in_cl.display, rel=2e-5, abs=1e-6)


@WORLDS
def test_a_machine_without_opencl_gives_the_same_light(world, monkeypatch):
    settings = dataclasses.replace(SETTINGS, iterations=2)
    with_opencl = drive(scene(world), settings)
    monkeypatch.setattr(without_opencl, "Compute", NoCompute)
    alone = drive(scene(world), dataclasses.replace(settings, sample_emission=True))
    assert (alone.report.method, alone.report.integrator) == ("cached", "glsl")
    assert set(alone.report.devices) == {"gl"} and "without OpenCL" in alone.report.warnings[0]
    assert alone.image == pytest.approx(with_opencl.image, rel=2e-5, abs=1e-6)


def test_what_takes_rays_takes_opencl(monkeypatch):
    monkeypatch.setattr(without_opencl, "Compute", NoCompute)
    room = scene(np.float32([1, 2, 3]))
    lamp = Light("Lamp", "point", np.ones(3), np.eye(3), np.ones(3, np.float32))
    with pytest.raises(DeviceError, match="needed for the light of lamps.*Install"):
        drive(dataclasses.replace(room, lights=(lamp,)), SETTINGS)
    with pytest.raises(DeviceError, match="needed for ambient occlusion.*Install"):
        drive(room, dataclasses.replace(SETTINGS, outputs=("ambient_occlusion",)))


def test_neither_opencl_nor_compute_shaders_is_a_clear_error(monkeypatch):
    monkeypatch.setattr(without_opencl, "Compute", NoCompute)
    monkeypatch.setattr(import_module("engine.bake"), "Graphics", OldGraphics)
    with pytest.raises(DeviceError, match="no OpenGL 4.3, so OpenCL is needed.*Install"):
        drive(scene(np.float32([1, 2, 3])), SETTINGS)


def test_a_batch_larger_than_a_storage_block_is_kept_in_parts(graphics, monkeypatch):
    """Hemicubes whose texels all see one patch gather just its radiance."""
    tiles, count = Tiles(8, 3, 1, 4), 11
    target = IdentityTarget(graphics, tiles)
    seen = np.ones((tiles.layers, tiles.height, tiles.width), np.uint32)
    target.texture.write(seen.tobytes())
    monkeypatch.setitem(graphics.context.info, "GL_MAX_SHADER_STORAGE_BLOCK_SIZE", 4 * 4 * 192)
    dark = np.zeros((1, 3), np.float32)
    cache = GlslCachedIntegrator(graphics, tiles, target.texture, dark, dark[None])
    cache.keep(np.tile(np.float32([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1]]), (count, 1, 1)))
    cache.set_radiance(np.float32([[1, 2, 3]]))
    assert cache.gather(0) == pytest.approx(np.tile([1, 2, 3, 1], (count, 1)), rel=1e-6)
    assert cache.batches == 1
