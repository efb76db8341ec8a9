"""Measures waiting times: first, warm and relit bakes, with kernel time and page faults."""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks import baking
from benchmarks.apart import run_apart
from benchmarks.configurations import settings
from benchmarks.driver_caches import driver_caches
from benchmarks.halls import hall
from benchmarks.interiors import furnished_room, sealed_rooms
from benchmarks.machine import has_bpy
from benchmarks.options import ROOT, Options
from benchmarks.profiled import busy_seconds
from benchmarks.rooms import cornell_box
from benchmarks.tables import percent, table
from engine import Light, Scene, Settings, finished
from engine.quality import QUALITIES
from engine.session import Session

try:
    import resource
except ImportError:
    resource = None  # type: ignore[assignment]

_SCENES: dict[str, Callable[[int], Scene]] = {
    "box": cornell_box,
    "hall": hall,
    "sealed rooms": sealed_rooms,
    "furnished room": furnished_room,
}

#: Warm bakes, and bakes after a change of light; an odd number, since the median counts.
_WARM = 5

#: Width of the lightmap of the first bake of a process, texels.
_COLD = 120


@dataclass(frozen=True)
class _Case:
    """Scene, width of its lightmap in texels, and its settings: a quality preset, or 256 rays."""

    scene: str
    resolution: int
    quality: str
    outputs: tuple[str, ...] = ("combined",)

    @property
    def settings(self) -> Settings:
        """The settings of the engine, but for the folder that keeps kernels."""
        values = {"samples": 256} if self.quality == "256 rays" else QUALITIES[self.quality].values
        return settings(values, resolution=self.resolution, outputs=self.outputs)


_DIRECTIONAL = ("combined", "directional")
_CARD = (
    _Case("box", 1024, "high"), _Case("box", 1024, "256 rays"), _Case("box", 1024, "high", _DIRECTIONAL),
    _Case("box", 512, "high"), _Case("box", 512, "high", _DIRECTIONAL), _Case("box", 1024, "preview"),
    _Case("hall", 2048, "preview"), _Case("hall", 2048, "high"), _Case("hall", 2048, "very_high"),
)  # fmt: skip


def run(options: Options) -> list[dict[str, Any]]:
    """Measure first bakes of a process, bakes of arrays, and the demo through the operator."""
    records = _cold_records()
    with tempfile.TemporaryDirectory(prefix="hemibake-bench-") as kernels:
        records += [_measured(case, kernels, against_truth=not options.gpu) for case in _cases(options)]
    return records + (_operator_records(options) if has_bpy() else [])


def tables(records: list[dict[str, Any]], options: Options) -> str:
    """Return tables of first bakes, warm bakes, and their stages."""
    cold = [record for record in records if record["kind"] == "cold"]
    warm = [record for record in records if record["kind"] == "arrays"]
    operator = [record for record in records if record["kind"] == "operator"]
    parts = [
        table(
            ("first bake of a process", "s", "whole process, s"),
            [(record["cached"], record.get("seconds") or record["failed"], record.get("process_seconds"))
             for record in cold],
        ),
        table(
            ("scene", "texels", "settings", "warm, s", "spread, s", "relit, s", "spread, s", "kernels, s",
             "CPU, s", "page faults", "error off edges"),
            [_row(record) for record in warm],
        ),
        _stages(warm),
    ]  # fmt: skip
    if operator:
        rows = [(record["what"], record["resolution"] ** 2, record["seconds"]) for record in operator]
        parts.append(table(("demo, through the operator", "texels", "s"), rows))
    return "\n\n".join(parts)


def cold(resolution: int, folder: str) -> dict[str, float]:
    """Bake for the first time in this process; return the times, s."""
    began = time.perf_counter()
    chosen = settings({}, resolution=resolution, cache_dir=folder)
    finished(Session().bake(cornell_box(resolution), chosen))
    return {"seconds": time.perf_counter() - began}


def _cold_records() -> list[dict[str, Any]]:
    """Return the first bakes of three processes, whose caches become fuller."""
    with tempfile.TemporaryDirectory(prefix="hemibake-bench-") as folder:
        arguments = {"resolution": _COLD, "folder": os.path.join(folder, "ours")}
        with driver_caches(folder):
            outcomes = [
                (cached, run_apart("benchmarks.suites.waiting:cold", arguments))
                for cached in ("nothing cached", "kernels cached")
            ]
    return [
        {
            "kind": "cold",
            "cached": cached,
            "process_seconds": outcome.seconds,
            **(outcome.value or {"failed": outcome.error}),
        }
        for cached, outcome in outcomes
    ]


def _cases(options: Options) -> tuple[_Case, ...]:
    """Return the cases; on a CPU the demo-like scenes have small lightmaps unless `full` is set."""
    if options.gpu:
        return _CARD
    resolution = 512 if options.full else 128
    scenes = ("box", "sealed rooms", "furnished room")
    return tuple(_Case(scene, resolution, "preview") for scene in scenes)


def _measured(case: _Case, kernels: str, against_truth: bool) -> dict[str, Any]:
    """Bake a case until it is warm, then again, then with a lamp and without; return the median of each.

    kernels:        folder of those that other cases have built
    against_truth:  True to measure the error, too, against a bake with many rays of every patch
    """
    scene, session = _SCENES[case.scene](case.resolution), Session()
    chosen = replace(case.settings, cache_dir=kernels)
    lit = replace(scene, lights=(*scene.lights, _lamp(scene)))
    try:
        _timed(session, scene, chosen)
        warm = []
        for _ in range(_WARM):
            session.forget()
            warm.append(_timed(session, scene, chosen))
        relit = [_timed(session, (lit, scene)[turn % 2], chosen) for turn in range(_WARM + 1)][1:]
        error = _error_off_edges(session, scene, chosen) if against_truth else None
    finally:
        session.close()
    return {
        "kind": "arrays", "scene": case.scene, "resolution": case.resolution, "quality": case.quality,
        "outputs": list(case.outputs), **_median(warm), "relit": _median(relit),
        "kernels": busy_seconds(scene, chosen), "error_off_edges": error,
    }  # fmt: skip


def _median(bakes: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the record of the bake with the median time, with the times of the fastest and the slowest."""
    ordered = sorted(bakes, key=lambda record: record["seconds"])
    spread = [ordered[0]["seconds"], ordered[-1]["seconds"]]
    return {**ordered[len(ordered) // 2], "spread": spread}


def _error_off_edges(session: Session, scene: Scene, chosen: Settings) -> float:
    """Return the RMSE off edges of light, relative to the mean, against a bake with many rays."""
    from tools.adaptive import TRUTH, errors

    truth = finished(session.bake(scene, replace(chosen, adaptive=False, **TRUTH)))
    lightmap = finished(session.bake(scene, chosen))
    return errors(lightmap, truth.display.astype(float), truth.known)[0]


def _timed(session: Session, scene: Scene, chosen: Settings) -> dict[str, Any]:
    """Bake; return the times."""
    faults, worked, began = _page_faults(), time.process_time(), time.perf_counter()
    lightmap = finished(session.bake(scene, chosen))
    seconds, worked = time.perf_counter() - began, time.process_time() - worked
    return {
        "seconds": seconds, "processor_seconds": worked, "page_faults": _page_faults() - faults,
        **baking.facts(lightmap),
    }  # fmt: skip


def _page_faults() -> int:
    """Return the pages that were mapped for this process so far; 0 where the system does not tell."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt if resource else 0


def _lamp(scene: Scene) -> Light:
    """Return a lamp in the middle of a scene."""
    corners = np.concatenate([mesh.positions.reshape(-1, 3) for mesh in scene.meshes])
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    return Light("Another", "point", middle.astype(float), np.eye(3), np.ones(3, np.float32))


def _operator_records(options: Options) -> list[dict[str, Any]]:
    """Return the first bake of the demo by the Bake operator, and the median of further ones."""
    sys.path.insert(0, str(ROOT / "tools"))
    from tools.headless import blender, quiet_stdout

    resolution = 1024 if options.gpu else 128
    with blender(), tempfile.TemporaryDirectory(prefix="hemibake-bench-") as folder:
        import bpy

        from benchmarks.contest import operator_bake

        sys.path.insert(0, str(ROOT / "examples"))
        import cornell_box as demo

        with quiet_stdout():
            bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
            demo.build()
        chosen = bpy.context.scene.hemibake
        chosen.resolution, chosen.directory = resolution, folder
        first, *warm = (operator_bake(bpy.context, {})[0] for _ in range(1 + _WARM))
    taken = {"first": first, "warm": statistics.median(warm)}
    return [
        {"kind": "operator", "what": what, "resolution": resolution, "seconds": seconds}
        for what, seconds in taken.items()
    ]


def _row(record: dict[str, Any]) -> tuple:
    return (
        record["scene"], record["resolution"] ** 2, _settings_text(record), record["seconds"],
        _spread(record), record["relit"]["seconds"], _spread(record["relit"]),
        sum(record["kernels"].values()), record["processor_seconds"], record["page_faults"],
        percent(record["error_off_edges"]),
    )  # fmt: skip


def _spread(record: dict[str, Any]) -> str:
    """Return the times of the fastest and the slowest bake, s."""
    return "–".join(f"{seconds:.3g}" for seconds in record["spread"])


def _settings_text(record: dict[str, Any]) -> str:
    """Return the quality of a case, and its outputs beside all light."""
    return ", ".join([record["quality"], *record["outputs"][1:]])


def _stages(records: list[dict[str, Any]]) -> str:
    """Return seconds of each stage, and the kernels that take the device longest."""
    stages = list(dict.fromkeys(stage for record in records for stage in record["stages"]))
    rows = [
        (record["scene"], record["resolution"] ** 2, _settings_text(record),
         *(record["stages"].get(stage) for stage in stages), _longest(record["kernels"]))
        for record in records
    ]  # fmt: skip
    return table(("scene", "texels", "settings", *stages, "kernels, ms"), rows)


def _longest(kernels: dict[str, float]) -> str:
    """Return the three kernels that take the device longest, ms."""
    ordered = sorted(kernels.items(), key=lambda pair: -pair[1])[:3]
    return ", ".join(f"{name} {1e3 * seconds:.3g}" for name, seconds in ordered)
