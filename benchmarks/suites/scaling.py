"""Measures time by stage and peak memory over patches and triangles, each case in its own process."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, sqrt
from typing import Any

from benchmarks import baking
from benchmarks.apart import run_apart
from benchmarks.configurations import settings
from benchmarks.options import Options
from benchmarks.rooms import cornell_box, hilly_room
from benchmarks.tables import mebibytes, table

_PATCHES = (10_000, 40_000, 160_000, 640_000, 2_500_000, 16_000_000)
_TRIANGLES = (24, 1_000, 10_000, 100_000, 1_000_000)

#: Fraction of a lightmap that the box's charts cover, about.
_COVERED = 0.75

#: What is baked: 256 rays a patch.
_VALUES = {"visibility": "rays", "samples": 256, "light_samples": 16, "tolerance": 0.01, "max_bounces": 8}

#: Device memory for visibility in the cases with little memory, bytes.
_BUDGET = 1 << 30

#: Width of the smaller room's lightmap, texels: it has more patches than 16 bits have numbers for; and a
#: budget that is short for it, bytes.
_SMALLER, _SMALL_BUDGET = 320, 4 << 20

_TITLES = {
    "patches": "Growing patches",
    "memory": "1 GiB for what patches see: patches are solved in groups",
    "triangles": "Growing triangles",
}

_STAGES = ("devices", "patches", "direct", "visibility", "hemicubes", "iterations", "solve", "outputs")


def run(options: Options) -> list[dict[str, Any]]:
    """Grow patches, then triangles, as long as a case takes less than a minute on a CPU."""
    limit = 600.0 if options.gpu else (60.0 if options.full else 25.0)
    width = 1024 if options.gpu else 192
    boxes = [
        {"kind": "patches", "size": size, "resolution": ceil(sqrt(size / _COVERED))} for size in _PATCHES
    ]
    short = {**boxes[-1], "kind": "memory", "budget": _BUDGET}
    floors = [{"kind": "triangles", "size": size, "resolution": width} for size in _TRIANGLES]
    return _grown(boxes, limit) + (_grown([short], limit) if options.gpu else []) + _grown(floors, limit)


def tables(records: list[dict[str, Any]], options: Options) -> str:
    """Return a table for each kind of growth."""
    stages = [stage for stage in _stages(records) if any(stage in _seconds(record) for record in records)]
    titles = ("asked for", "patches", "triangles", "method", *stages, "total", "host peak", "device peak")
    parts = []
    for kind in ("patches", "memory", "triangles"):
        rows = [_row(record, stages) for record in records if record["kind"] == kind]
        if not rows:
            continue
        parts.append(f"{_TITLES[kind]}, seconds by stage\n\n{table(titles, rows)}")
    return "\n\n".join(parts)


def case(kind: str, size: int, resolution: int, budget: int = 0) -> dict[str, Any]:
    """Bake a smaller room in the same way, so that all is built, then the case; return its figures."""
    build: Callable = hilly_room if kind == "triangles" else cornell_box
    scene = build(resolution, size) if kind == "triangles" else build(resolution)
    smaller = min(resolution, _SMALLER)
    warm_up = settings(_VALUES, resolution=smaller, memory_budget=budget and _SMALL_BUDGET)
    baking.timed(cornell_box(smaller), warm_up)
    seconds, lightmap = baking.timed(scene, settings(_VALUES, resolution=resolution, memory_budget=budget))
    triangles = sum(len(mesh.positions) for mesh in scene.meshes)
    return {"seconds": seconds, "triangles": triangles, **baking.facts(lightmap)}


def _grown(cases: list[dict[str, Any]], limit: float) -> list[dict[str, Any]]:
    """Return the records of cases of growing size; those after one that takes too long are left out."""
    records, too_long = [], ""
    for index, arguments in enumerate(cases):
        if too_long:
            records.append({**arguments, "skipped": too_long})
            continue
        outcome = run_apart("benchmarks.suites.scaling:case", arguments, 2 * limit, watched=True)
        facts = outcome.value or {"failed": outcome.error}
        device = facts.get("device_bytes") or outcome.device_bytes
        records.append({**arguments, **facts, "host_bytes": outcome.host_bytes, "device_bytes": device})
        if index + 1 < len(cases) and not outcome.value:
            too_long = "a smaller one failed"
        elif index + 1 < len(cases):
            growth = cases[index + 1]["size"] / arguments["size"] if arguments["kind"] == "patches" else 1
            if facts["seconds"] * growth > limit:
                too_long = f"would take more than {limit:.0f} s"
    return records


def _seconds(record: dict[str, Any]) -> dict[str, float]:
    return record.get("stages", {})


def _stages(records: list[dict[str, Any]]) -> list[str]:
    """Return the names of all stages in the order of a bake."""
    found = list(dict.fromkeys(stage for record in records for stage in _seconds(record)))
    return [stage for stage in _STAGES if stage in found] + [name for name in found if name not in _STAGES]


def _row(record: dict[str, Any], stages: list[str]) -> tuple:
    said = record.get("method") or record.get("skipped") or record.get("failed")
    return (
        record["size"], record.get("patches"), record.get("triangles"), said,
        *(_seconds(record).get(stage) for stage in stages), record.get("seconds"),
        mebibytes(record.get("host_bytes")), mebibytes(record.get("device_bytes")),
    )  # fmt: skip
