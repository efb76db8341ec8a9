"""Means over groups of patches are those of NumPy."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Settings
from engine.device.cl_device import ComputeDevice
from engine.patches.patch_scene import make_patch_scene
from engine.solve.patch_groups import PatchGroups, group_representatives
from engine.validity.invalid import patches_inside
from engine.visibility.rays.ray_scene import RayScene
from tests.analytic.scenes import nine_quad_room


@pytest.mark.parametrize(("resolution", "width"), [(67, 2), (131, 4), (128, 8)])
def test_means_are_those_of_the_members(
    graphics, compute: ComputeDevice, resolution: int, width: int
) -> None:
    """Two lightmaps whose squares end in the middle of some; patches that differ stay apart; few shine."""
    room = nine_quad_room()
    again = replace(
        room.meshes[0], name="Again", atlas=1, positions=room.meshes[0].positions + np.float32(50)
    )
    scene = replace(room, meshes=(*room.meshes, again), atlases=(*room.atlases, "Again"))
    patch_scene = make_patch_scene(graphics, compute, scene, Settings(resolution=resolution))
    random, count = np.random.default_rng(width), len(patch_scene.patches)
    light = (random.random((count, 3)) < 0.1).astype(np.float32)
    emission = np.where(random.random(count) < 0.01, 9, 0)[:, None].astype(np.float32) * np.ones(
        3, np.float32
    )
    patch_scene = replace(patch_scene, surfaces=replace(patch_scene.surfaces, emission=emission))
    rays, area = RayScene(compute, patch_scene), random.random(count).astype(np.float32)
    groups = PatchGroups(
        rays,
        patch_scene,
        area,
        group_representatives(rays, patch_scene, light.sum(1), patches_inside(rays, count), width),
        width,
    )
    members = np.bincount(groups.group)
    assert len(np.unique(members)) > 2 and width**2 / 2 < members.max() <= width**2
    assert groups.patch_scene.patches.atlas.any()

    def expected(values: np.ndarray) -> np.ndarray:
        sums = [np.bincount(groups.group, column) for column in values.reshape(count, -1).T]
        return (np.stack(sums, axis=1) / members[:, None]).reshape(-1, *values.shape[1:])

    for values in (random.random((count, 3)).astype(np.float32), area, emission, 1e25 * light, 0 * light):
        np.testing.assert_allclose(groups.mean(values), expected(values), rtol=3e-6)
    np.testing.assert_allclose(groups.area, expected(area) * members, rtol=3e-6)
    np.testing.assert_allclose(groups.patch_scene.surfaces.emission, expected(emission), rtol=3e-6)
