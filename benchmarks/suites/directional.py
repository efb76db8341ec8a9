"""Measures time and processor time of directional maps, by stage."""

from __future__ import annotations

import re
import statistics
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from contextlib import closing
from typing import Any

from benchmarks.configurations import settings
from benchmarks.interiors import furnished_room
from benchmarks.options import Options
from benchmarks.profiled import busy_seconds
from benchmarks.rooms import cornell_box
from benchmarks.tables import percent, table
from engine import Scene, Settings
from engine.quality import QUALITIES
from engine.session import Session

_SCENES: dict[str, Callable[[int], Scene]] = {"box": cornell_box, "furnished room": furnished_room}

#: Sets of directional maps to bake; the first, without maps, is the baseline.
_MAPS = ((), ("directional",), ("dominant_direction",), ("spherical_harmonics",))

_QUALITIES = ("preview", "high")

#: Warm bakes of each; the one in the middle counts. They take turns, so that all meet the same machine.
_ROUNDS = 3


def run(options: Options) -> list[dict[str, Any]]:
    """Bake every scene in every quality with each of the maps."""
    resolution = 1024 if options.gpu else 256
    records = []
    with tempfile.TemporaryDirectory(prefix="hemibake-bench-") as kernels:
        for name, make in _SCENES.items():
            for quality in _QUALITIES:
                scene = make(resolution)
                chosen = [_settings(quality, resolution, maps, kernels) for maps in _MAPS]
                facts = {"scene": name, "resolution": resolution, "quality": quality}
                records += [
                    {**facts, "maps": list(maps), **taken}
                    for maps, taken in zip(_MAPS, _in_turns(scene, chosen), strict=True)
                ]
    return records


def tables(records: list[dict[str, Any]], options: Options) -> str:
    """Return tables of times, of the difference to bakes without maps, and of stages and kernels."""
    stages = list(dict.fromkeys(stage for record in records for stage in record["stages"]))
    rows = [
        (*_named(record), record["seconds"], percent(_more(record, records, "seconds")),
         record["processor_seconds"], percent(_more(record, records, "processor_seconds")),
         *(record["stages"].get(stage) for stage in stages))
        for record in records
    ]  # fmt: skip
    titles = ("scene", "texels", "quality", "maps", "s", "more", "CPU, s", "more CPU")
    kernels = [
        (*_named(record), 1e3 * sum(record["kernels"].values()), _longest(record)) for record in records
    ]
    return "\n\n".join(
        (
            table((*titles, *(f"{stage}, CPU s" for stage in stages)), rows),
            table((*titles[:4], "kernels, ms", "the longest, ms"), kernels),
        )
    )


def _settings(quality: str, resolution: int, maps: tuple[str, ...], kernels: str) -> Settings:
    return settings(
        QUALITIES[quality].values, resolution=resolution, outputs=("combined", *maps), cache_dir=kernels
    )


def _in_turns(scene: Scene, several: list[Settings]) -> list[dict[str, Any]]:
    """Return the measurements of alternating warm bakes of a scene with several settings."""
    taken: list[list[dict[str, Any]]] = [[] for _ in several]
    session = Session()
    try:
        for number in range(_ROUNDS + 1):
            for chosen, records in zip(several, taken, strict=True):
                session.forget()
                measured = _timed(session, scene, chosen)
                if number:
                    records.append(measured)
    finally:
        session.close()
    return [
        {**_middle(records), "kernels": busy_seconds(scene, chosen)}
        for records, chosen in zip(taken, several, strict=True)
    ]


def _timed(session: Session, scene: Scene, chosen: Settings) -> dict[str, Any]:
    """Bake; return wall time and processor time, s, and the latter by stages."""
    stages: dict[str, float] = defaultdict(float)
    began, worked = time.perf_counter(), time.process_time()
    before = worked
    with closing(session.bake(scene, chosen)) as bake:
        for progress in bake:
            now = time.process_time()
            stages[re.sub(r" \d+$", "s", progress.stage)] += now - before
            before = now
    return {
        "seconds": time.perf_counter() - began, "processor_seconds": time.process_time() - worked,
        "stages": dict(stages),
    }  # fmt: skip


def _middle(records: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the medians of the measurements of several bakes."""
    stages = {stage for record in records for stage in record["stages"]}
    middle: dict[str, Any] = {
        name: statistics.median(record[name] for record in records)
        for name in ("seconds", "processor_seconds")
    }
    middle["stages"] = {
        stage: statistics.median(record["stages"].get(stage, 0.0) for record in records)
        for stage in sorted(stages)
    }
    return middle


def _more(record: dict[str, Any], records: list[dict[str, Any]], name: str) -> float | None:
    """Return a measurement's relative difference to the bake without maps; None for that bake."""
    if not record["maps"]:
        return None
    same = ("scene", "resolution", "quality")
    plain = next(
        other for other in records if not other["maps"] and all(other[key] == record[key] for key in same)
    )
    return float(record[name] / plain[name] - 1)


def _named(record: dict[str, Any]) -> tuple:
    return record["scene"], record["resolution"] ** 2, record["quality"], ", ".join(record["maps"]) or "none"


def _longest(record: dict[str, Any]) -> str:
    """Return the six kernels that take the device longest, ms."""
    ordered = sorted(record["kernels"].items(), key=lambda pair: -pair[1])[:6]
    return ", ".join(f"{name} {1e3 * seconds:.3g}" for name, seconds in ordered)
