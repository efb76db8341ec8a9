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


def test_suns_of_a_sky_have_no_shadow_mask():
    lamp = replace(sky_sun((0, 0, 1), 0.1), name="Lamp", of_world=False)
    scene = replace(nine_quad_room(), lights=(sky_sun((0, 1, 1), 0.1), lamp))
    assert output_names(scene, replace(Settings(), outputs=("shadow_mask",))) == ["shadow_mask Lamp"]
    assert shining_lights(scene)[0] == lamp
