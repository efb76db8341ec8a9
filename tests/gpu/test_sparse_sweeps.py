"""First iterations with few samples lead to the same light."""

import dataclasses

import numpy as np
import pytest

from engine import Light, Settings, bake, finished
from engine.gather import cached_gather
from engine.gather.gather_kernels import GatherKernels
from tests.analytic.scenes import nine_quad_room

#: A room of prime size; 1,036 samples are 259 fours, which are no multiple of the stride.
SETTINGS = Settings(
    resolution=37, samples=1036, visibility="rays", method="cached", light_samples=16, texel_samples=1,
    adaptive=False, hide_seams=False, intermediates=False,
)  # fmt: skip


@pytest.fixture
def strides(monkeypatch):
    """Return a list of the strides of all sweeps to come."""
    found = []

    class Noting(GatherKernels):
        def gather(self, rows, radiance, static_light, outputs, stride=1):
            found.append(stride)
            super().gather(rows, radiance, static_light, outputs, stride)

    monkeypatch.setattr(cached_gather, "GatherKernels", Noting)
    return found


def room():
    lamp = Light("Lamp", "point", np.array([1.1, 1.7, 1.9]), np.eye(3), np.float32([5, 4, 3]), radius=0.1)
    return dataclasses.replace(nine_quad_room(), lights=(lamp,))


def test_light_is_that_of_all_samples(strides, monkeypatch):
    sparse = finished(bake(room(), SETTINGS))
    used, strides[:] = list(strides), []
    monkeypatch.setattr(cached_gather, "_MANY", 10_000)
    full = finished(bake(room(), SETTINGS))
    assert set(strides) == {1} and len(strides) == full.report.iterations
    assert used[0] == cached_gather.STRIDE and used[-2:] == [1, 1] and used.count(1) <= 3
    assert sparse.report.converged and len(used) == sparse.report.iterations
    lit = full.image[full.has_patch]
    differ = np.abs(sparse.image[full.has_patch] - lit).mean() / lit.mean()
    assert 0 < differ < SETTINGS.tolerance


@pytest.mark.parametrize(
    "changes",
    [{"samples": 1020}, {"tolerance": 0, "max_bounces": 4}, {"accelerate": False}],
    ids=lambda changes: next(iter(changes)),
)
def test_few_samples_or_sweeps_are_not_thinned_out(strides, changes):
    finished(bake(room(), dataclasses.replace(SETTINGS, **changes)))
    assert set(strides) == {1}
