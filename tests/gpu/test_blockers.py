"""Shadow rays tested against a list of blockers give the same result as a full traversal."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.interiors import sealed_rooms
from benchmarks.rooms import hilly_room
from engine import Light, Settings, finished
from engine.device.cl_device import ComputeDevice
from engine.device.devices import Devices
from engine.pipeline import bake
from engine.plan.rates import ray_speed
from engine.plan.session_cache import SessionCache
from engine.plan.stages import BakeStages, Extent
from tests.gpu.graphics_card import GraphicsCard
from tests.rows import long

WIDTH = 61


def lamp_room(width):
    """Return hills below an area lamp, parts of which many triangles hide."""
    lamp = Light(
        "Lamp", "area", np.array([0.4, 0.3, 0.9]), np.eye(3), np.full(3, 3.0, np.float32), size=(0.7, 0.2)
    )
    return replace(hilly_room(width, 900), lights=(lamp,))


def direct_light(compute_class, scene, outputs):
    """Return direct light of each patch, (n, 3), with shadow rays from a device of a class."""
    settings = Settings(
        resolution=WIDTH, samples=16, light_samples=48, max_bounces=1, tolerance=0, visibility="rays",
        texel_samples=1, outputs=outputs, hide_seams=False,
    )  # fmt: skip
    devices = Devices(None)
    devices.compute = compute_class()
    try:
        stages = BakeStages(Extent.of(scene), settings, {})
        stages.opened(ray_speed(devices))
        lightmap = finished(bake(devices, scene, settings, stages, SessionCache()))
    finally:
        devices.release()
    return lightmap.passes["direct"][lightmap.has_patch][:, :3]


@pytest.mark.parametrize(
    ("room", "outputs"),
    [
        (lamp_room, ("combined", "direct")),
        long(sealed_rooms, ("combined", "direct")),
        long(sealed_rooms, ("combined", "direct", "directional")),
    ],
    ids=["hills", "rooms", "rooms with directions"],
)
def test_light_is_that_of_rays_through_the_scene(room, outputs):
    scene = room(WIDTH)
    near, all_of_it = (direct_light(made, scene, outputs) for made in (ComputeDevice, GraphicsCard))

    # Rays that graze an edge are rounded either way.
    off = np.abs(near - all_of_it).max(axis=1) > 1e-3 * all_of_it.mean()
    assert all_of_it.mean() > 0
    assert off.mean() < 0.01
    assert near.mean() == pytest.approx(all_of_it.mean(), rel=1e-3)
