"""Bakes give the same bits for any sizes of slices."""

import numpy as np
import pytest

from engine import Light, Scene, Settings
from engine.device.cl_device import ComputeDevice
from engine.device.time_slicer import SliceLimits, TimeSlicer
from tests.analytic.drive import drive
from tests.analytic.scenes import furnace

OUTPUTS = ("combined", "shadow_mask", "ambient_occlusion")
SETTINGS = Settings(
    resolution=23, visibility="rays", samples=17, max_bounces=3, tolerance=0, light_samples=5, ao_samples=5,
    outputs=OUTPUTS,
)  # fmt: skip


def room() -> Scene:
    """Return a furnace with a lamp."""
    lamp = Light("Lamp", "point", np.full(3, 0.41), np.eye(3), np.ones(3, np.float32), radius=0.13)
    closed = furnace(0.5, 1.0)
    return Scene(closed.meshes, closed.materials, lights=(lamp,))


class Forced(TimeSlicer):
    """Slices of sizes that change at random."""

    def __init__(self):
        super().__init__(SliceLimits(3, 1, 1, 1.0))
        self.used = []

    def _adapt(self, done):
        self.used.append(done.items)
        self._items = int(np.random.default_rng(len(self.used)).integers(1, 29))


@pytest.mark.parametrize("method", ["cached", "stream"])
def test_any_sizes_of_slices_bake_the_same_bits(monkeypatch, method):
    settings = Settings(**(vars(SETTINGS) | {"method": method}))
    whole = drive(room(), settings)
    forced = Forced()
    monkeypatch.setattr(ComputeDevice, "slice_size", lambda self, kernel, *work, items=1: forced)
    parts = drive(room(), settings)
    assert len(forced.used) > 60 and len(set(forced.used)) > 20
    for name, image in whole.passes.items():
        assert np.array_equal(image, parts.passes[name]), name
