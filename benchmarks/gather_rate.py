"""Measures the bandwidth of the gather kernel of `engine.gather.cached_gather`."""

from __future__ import annotations

import time
from typing import Any

from benchmarks.configurations import settings
from benchmarks.profiled import ProfiledCompute
from benchmarks.rooms import cornell_box
from benchmarks.solving import solving
from engine.visibility.sample_counts import sample_bytes

#: Name of the kernel that sums the visibility samples of patches.
_KERNEL = "gather"

_REPEATS = 5


def gather_bytes_per_second(values: dict[str, Any], resolution: int) -> dict[str, Any]:
    """Return bytes of indices that one iteration reads, the kernel's best seconds for them, and their ratio.

    Radiance and weights, which caches hold, are not counted. `iteration_seconds` is the best wall time
    of an iteration with all that the host does.
    """
    compute = ProfiledCompute()
    chosen = settings({"method": "cached", "tolerance": 0, **values}, resolution=resolution)
    with solving(cornell_box(resolution), chosen, compute) as (solver, choice, patches):
        if choice.method != "cached":
            raise RuntimeError(f"what patches see does not fit the device's memory with {values}")
        _drain(solver.iteration())
        kernel, wall = [], []
        for _ in range(_REPEATS):
            compute.events.clear()
            started = time.perf_counter()
            _drain(solver.iteration())
            wall.append(time.perf_counter() - started)
            kernel.append(compute.seconds(_KERNEL))
    size = patches * choice.samples * sample_bytes(patches)
    return {
        "samples": choice.samples,
        "visibility": choice.visibility,
        "patches": patches,
        "bytes": size,
        "seconds": min(kernel),
        "iteration_seconds": min(wall),
        "bytes_per_second": size / min(kernel),
    }


def _drain(work: Any) -> None:
    for _ in work:
        pass
