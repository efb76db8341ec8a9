"""Every OpenCL driver of this machine bakes the same light: where there are several, kernels are portable."""

import dataclasses

import numpy as np
import pytest

from engine import Light, Settings, finished
from engine.device.cl_device import device_issue, device_name, found_devices
from engine.session import Session
from tests.gpu.test_live import LIT, ROOM

SETTINGS = Settings(resolution=37, hemicube=8, samples=64, light_samples=9, hide_seams=True, texel_samples=4)

SUN = Light("Sun", "sun", np.zeros(3), np.eye(3), np.float32([1, 1, 0.9]))
PANEL = Light("Panel", "area", np.ones(3), np.eye(3), np.float32([2, 3, 1]), size=np.array([0.4, 0.2]))
SCENE = dataclasses.replace(ROOM, lights=(*LIT, SUN, PANEL))

_NAMES = [device_name(device) for device in found_devices() if not device_issue(device)]
DEVICES = list(dict.fromkeys(_NAMES))


@pytest.fixture(scope="module")
def sessions():
    """A session for each device: a driver builds programs for seconds."""
    made = {name: Session() for name in DEVICES}
    yield made
    for session in made.values():
        session.close()


@pytest.mark.skipif(len(DEVICES) < 2, reason="one OpenCL driver alone")
@pytest.mark.parametrize(
    "changes",
    [
        {"outputs": ("combined", "direct", "ambient_occlusion", "shadow_mask", "directional")},
        {"visibility": "raster"},
        {"method": "stream"},
        {"patch_groups": 2},
    ],
    ids=["outputs", "drawn", "stream", "groups"],
)
def test_every_driver_bakes_the_same_light(sessions, changes):
    """Rays that end beside an edge may differ: a texel in a hundred."""
    settings = dataclasses.replace(SETTINGS, **{"visibility": "rays", **changes})
    first, *others = [
        finished(session.bake(SCENE, dataclasses.replace(settings, opencl_device=name)))
        for name, session in sessions.items()
    ]
    for name, other in zip(DEVICES[1:], others, strict=True):
        known = first.known & other.known
        assert known.sum() > 0.99 * first.known.sum()
        for output, values in first.passes.items():
            mean = np.abs(values[known]).mean()
            apart = np.abs(other.passes[output] - values)[known] / mean
            assert apart.mean() < 1e-3 and (apart > 1e-2).mean() < 1e-2, (name, output)
