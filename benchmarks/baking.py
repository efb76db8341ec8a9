"""Timed bakes of array scenes."""

from __future__ import annotations

import time
from typing import Any

from engine import BakeResult, Scene, Settings, finished
from engine.device.freed_memory import keep_freed_memory
from engine.session import Session

#: A bake faster than this is timed a second time, s.
_QUICK = 10.0

#: Keeps contexts, shaders and kernels, as the worker of a windowed Blender does.
_session = Session()

# As the worker does.
keep_freed_memory()


def timed(scene: Scene, settings: Settings) -> tuple[float, BakeResult]:
    """Bake; return the wall time in seconds and the lightmap."""
    started = time.perf_counter()
    lightmap = finished(_session.bake(scene, settings))
    return time.perf_counter() - started, lightmap


def best_of_two(scene: Scene, settings: Settings) -> tuple[float, BakeResult]:
    """Bake once, or twice if it is quick; return the best time and its lightmap."""
    first = timed(scene, settings)
    return min(first, timed(scene, settings), key=lambda pair: pair[0]) if first[0] < _QUICK else first


def facts(lightmap: BakeResult) -> dict[str, Any]:
    """Return the figures of a bake's report, ready for JSON, with the engine's own count of device memory."""
    report = lightmap.report
    return {
        "patches": int(report.patches),
        "method": report.method,
        "iterations": int(report.iterations),
        "stages": {stage: float(seconds) for stage, seconds in report.seconds.items()},
        "device_bytes": getattr(report, "device_bytes", None),
    }
