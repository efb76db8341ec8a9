"""Work groups of any shape give the same light."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Settings, finished
from engine.device.buffers import upload
from engine.device.cl_device import ComputeDevice
from engine.device.devices import Devices
from engine.device.work_sizes import WorkSizes
from engine.gather.opencl_integrator import HemicubeIntegrator
from engine.pipeline import bake
from engine.plan.rates import ray_speed
from engine.plan.session_cache import SessionCache
from engine.plan.stages import BakeStages, Extent
from engine.visibility.raster.tiles import Tiles
from engine.visibility.views.hemicube import multiplier_map
from tests.analytic.scenes import nine_quad_room


def test_a_bake_uses_the_shapes_kept_in_its_folder_and_finds_the_same_light(tmp_path):
    scene, light = nine_quad_room(), []
    settings = Settings(resolution=24, samples=96, visibility="rays", cache_dir=str(tmp_path), tolerance=1e-4)
    for sizes in (None, WorkSizes(look=(8,), gather=(16,))):
        devices = Devices(settings.cache_dir)
        try:
            if sizes:
                devices.compute.kept_sizes(str(tmp_path)).keep(sizes, devices.compute.default_sizes)
                devices.release()
                devices = Devices(settings.cache_dir)
                assert devices.compute.work_sizes == replace(sizes, multiply=(32, 16, 1))
            stages = BakeStages(Extent.of(scene), settings, {})
            stages.opened(ray_speed(devices))
            light.append(finished(bake(devices, scene, settings, stages, SessionCache())).image)
        finally:
            devices.release()
    assert light[0].max() > 0
    assert light[1] == pytest.approx(light[0], rel=2e-5, abs=1e-6)


@pytest.mark.parametrize(
    "sizes",
    [
        WorkSizes(),
        WorkSizes(multiply=(1, 1, 1), reduce_row=(8, 8), reduce_column=(1,)),
        WorkSizes(multiply=(8, 8, 2), reduce_row=(256, 4), reduce_column=(4,)),
    ],
)
def test_hemicubes_are_integrated_by_groups_of_any_shape(sizes):
    compute, tiles = ComputeDevice(), Tiles(8, 5, 3, 3)
    compute.work_sizes = sizes
    random = np.random.default_rng(7)
    texels = random.random((tiles.layers, tiles.height, tiles.width, 4), np.float32)
    frames = np.tile(np.float32([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1]]), (tiles.capacity, 1, 1))
    buffer = upload(compute, texels)
    found = HemicubeIntegrator(compute, tiles, np.zeros((1, 1, 3), np.float32)).integrate(buffer, frames)
    cubes = texels.reshape(3, 3, 24, 5, 8, 4).swapaxes(2, 3).reshape(45, 24, 8, 4).astype(float)
    assert found == pytest.approx(np.einsum("kyxc,yx->kc", cubes, multiplier_map(8)), rel=1e-5)
