"""Measures milliseconds per iteration of the room with 10,700 patches, the paper's Fig. 5."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.configurations import settings
from benchmarks.options import Options
from benchmarks.solving import solving, time_iterations, warm_up
from benchmarks.tables import table
from tests.analytic.scenes import nine_quad_room

#: Size of the paper's texture array, and of the lightmap, texels.
_ARRAY, _RESOLUTION = 1024, 128

_LAYERS = (1, 2, 4, 8)

_PAPER = Path(__file__).resolve().parents[1] / "paper_fig5.json"

#: Iterations that the paper's mean is taken over.
_ITERATIONS = 30


def run(options: Options) -> list[dict[str, Any]]:
    """Time every hemicube width and number of layers, then method `cached`."""
    budget = 60.0 if options.full else (10.0 if options.gpu else 6.0)
    records = []
    for row in _paper()["iterations"]:
        n = row["hemicube"]
        records += [_drawn(n, layers, budget) for layers in _LAYERS]
        if options.gpu:
            records += [_drawn(n, None, budget, half) for half in (False, True)]
        records.append(_cached(n, budget, 10 * budget))
    return records


def tables(records: list[dict[str, Any]], options: Options) -> str:
    """Return ours beside the paper's; the newest stored figures stand for the other kind of device."""
    paper, other = _paper(), _stored(options, records)
    rows = [row for record in records for row in _rows(record, records, other, paper)]
    kind, rest = ("GPU", "CPU") if records[0]["gpu"] else ("CPU", "GPU")
    titles = (
        "hemicube", "layers", "method", "paper, CPU", "paper, GPU", f"ours, this {kind}", f"ours, {rest}",
        "paper / ours", "patches timed",
    )  # fmt: skip
    where = f"{rest} figures: {other['source']}" if other else f"No {rest} figures are stored yet."
    return f"ms per iteration. Paper: {paper['cpu']}; {paper['gpu']}.\n{where}\n\n{table(titles, rows)}"


def _drawn(n: int, layers: int | None, budget: float, half: bool = False) -> dict[str, Any]:
    """Time method `paper`: hemicubes are drawn in every iteration.

    layers: of the paper's array, None for batches as they fit; half: in 16-bit floats
    """
    size = (_ARRAY, _ARRAY, layers) if layers else (0, 0, 0)
    chosen = settings(
        {"method": "paper", "hemicube": n, "visibility": "raster", "array_size": size, "half_radiance": half},
        resolution=_RESOLUTION, sample_emission=False,
    )  # fmt: skip
    with solving(nine_quad_room(), chosen) as (solver, choice, patches):
        warm_up(solver)
        timing = time_iterations(solver, _ITERATIONS, budget)
    name = "paper, float16" if half else choice.method
    return _record(n, layers, name, patches, timing)


def _cached(n: int, budget: float, drawing_budget: float) -> dict[str, Any]:
    """Time method `cached`: the first iteration, which draws (and builds shaders), and those after it."""
    chosen = settings(
        {"method": "cached", "hemicube": n, "visibility": "raster"},
        resolution=_RESOLUTION, sample_emission=False,
    )  # fmt: skip
    with solving(nine_quad_room(), chosen) as (solver, choice, patches):
        first = time_iterations(solver, 1, drawing_budget)
        first_facts = {"first_ms": 1000 * first.seconds, "first_fraction": first.fraction}
        if first.fraction < 1:
            reason = f"drawing takes more than {drawing_budget:.0f} s"
            return {"hemicube": n, "layers": None, "method": choice.method, "skipped": reason, **first_facts}
        time_iterations(solver, 1, budget)
        timing = time_iterations(solver, _ITERATIONS, budget)
    return {**_record(n, None, choice.method, patches, timing), **first_facts}


def _record(n: int, layers: int | None, method: str, patches: int, timing) -> dict[str, Any]:
    return {
        "hemicube": n,
        "layers": layers,
        "method": method,
        "patches": patches,
        "ms": 1000 * timing.seconds,
        "iterations": timing.iterations,
        "fraction": timing.fraction,
    }


def _rows(record: dict, records: list[dict], other: dict | None, paper: dict) -> Iterator[tuple]:
    n, layers, method = record["hemicube"], record["layers"], record["method"]
    known = next(row for row in paper["iterations"] if row["hemicube"] == n)
    theirs = known["gpu" if record["gpu"] else "cpu"]
    theirs = theirs.get(str(layers), min(theirs.values()))
    ours = record.get("ms")
    elsewhere = next(
        (found.get("ms") for found in (other or {"records": []})["records"] if _same(found, record)), None
    )
    yield (
        n, layers, method, known["cpu"].get(str(layers)), known["gpu"].get(str(layers)),
        ours if ours is not None else record["skipped"], elsewhere, theirs / ours if ours else None,
        f"{record['fraction']:.0%}" if "fraction" in record else None,
    )  # fmt: skip


def _same(found: dict, record: dict) -> bool:
    return all(found[name] == record[name] for name in ("hemicube", "layers", "method"))


def _paper() -> dict[str, Any]:
    return json.loads(_PAPER.read_text(encoding="utf-8"))


def _stored(options: Options, records: list[dict]) -> dict[str, Any] | None:
    """Return the newest stored records of the other kind of device, and where they are from."""
    for path in sorted(Path(options.results).glob("*-[cg]pu-*.json"), reverse=True):
        stored = json.loads(path.read_text(encoding="utf-8"))
        opencl, suite = stored["machine"]["opencl"], stored["suites"].get("fig5", {})
        if opencl["gpu"] != records[0]["gpu"] and suite.get("records"):
            source = f"{opencl['device']}, commit {stored['machine']['commit']}, {path.name}"
            return {"records": suite["records"], "source": source}
    return None
