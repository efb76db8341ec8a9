"""Scenes that need OpenCL are refused before the bake begins."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from engine import Settings
from engine.errors import DeviceError
from engine.plan.opencl_fallback import without_opencl
from engine.postprocess.output_names import output_names
from engine.scene.model import Light, shining_lights
from engine.scene.sky_maps import directions, solid_angles
from engine.scene.sky_suns import put_suns_into_world
from tests.analytic.scenes import nine_quad_room


def test_workers_need_opencl_at_the_client():
    nothing = SimpleNamespace(compute=None, missing="Install a driver.", graphics=None)
    with pytest.raises(DeviceError, match="needed for a bake by workers. Install a driver"):
        without_opencl(nothing, nine_quad_room(), replace(Settings(), scheduler="all"))


def sky_sun(direction, half_angle):
    towards = np.asarray(direction, float) / np.linalg.norm(direction)
    axes = np.stack([np.zeros(3), np.zeros(3), towards])
    strength = np.float32([3, 2, 1])
    return Light("Sun of world 'W'", "sun", np.zeros(3), axes, strength, half_angle=half_angle, of_world=True)


@pytest.mark.parametrize("half_angle", [1e-4, 0.3])
def test_without_opencl_the_world_shows_the_suns_of_its_sky(half_angle):
    towards = np.array([0.3, -0.8, 0.4])
    lamp = replace(sky_sun((0, 0, 1), 0.1), name="Lamp", of_world=False)
    room = replace(nine_quad_room(), world=np.float32([0.1, 0.1, 0.1]))
    scene = put_suns_into_world(replace(room, lights=(sky_sun(towards, half_angle), lamp)))
    assert scene.lights == (lamp,)
    height, width = scene.world.shape[:2]
    seen = directions((np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width)
    added = (scene.world - 0.1) * solid_angles(height, width)[:, None, None]
    vector = np.einsum("yxc,yxd->cd", added, seen)
    assert np.linalg.norm(vector, axis=1) == pytest.approx([3, 2, 1], rel=2e-3)
    assert vector[0] / 3 == pytest.approx(towards / np.linalg.norm(towards), abs=0.01)


def test_a_scene_without_suns_of_a_sky_stays():
    room = nine_quad_room()
    assert put_suns_into_world(room) is room


def test_suns_of_a_sky_have_no_shadow_mask():
    lamp = replace(sky_sun((0, 0, 1), 0.1), name="Lamp", of_world=False)
    scene = replace(nine_quad_room(), lights=(sky_sun((0, 1, 1), 0.1), lamp))
    assert output_names(scene, replace(Settings(), outputs=("shadow_mask",))) == ["shadow_mask Lamp"]
    assert shining_lights(scene)[0] == lamp
