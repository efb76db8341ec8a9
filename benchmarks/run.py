"""Runs the benchmarks, prints tables and stores every result as JSON.

    python benchmarks/run.py [--suite NAME ...] [--gpu] [--full] [--out FOLDER]

Each suite runs in its own process: a failed suite is reported and the others continue.
docs/design/benchmarks.md explains the tables.
"""

from __future__ import annotations

import argparse
import importlib
import json
import re
import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.apart import run_apart
from benchmarks.options import Options

SUITES = {
    "fig5": "the paper's Fig. 5: ms per iteration",
    "equal_error": "seconds to the same error, Hemibake and Cycles",
    "scaling": "stages and memory over patches and triangles",
    "bandwidth": "the gather kernel against a copy",
    "endtoend": "Cornell box, arrays to arrays, to 2 %",
    "lights": "direct light of 1 to 1,000 lamps",
    "waiting": "first, warm and relit bakes: stages, device, page faults",
    "directional": "what directional maps cost, by stage",
    "relit": "bakes after a change of light over the part of the visibility that is kept",
    "probes": "light probes: first bake, and after a change of light",
    "large": "time and memory of millions of triangles, texels and instances",
    "levels": "bakes of large levels from Blender: CPU time and memory of each stage, with unwrapping",
}


def main() -> None:
    """Run the suites, print their tables, and store the results."""
    arguments = _parse()
    folders = {"scenes": str(arguments.scenes.resolve()), "results": str(arguments.out.resolve())}
    only = tuple(arguments.scene)
    options = Options(gpu=arguments.gpu, full=arguments.full, only=only, **folders)
    machine = _machine(arguments.gpu)
    print(_machine_text(machine))
    stored: dict[str, Any] = {"machine": machine, "options": {"gpu": options.gpu, "full": options.full}}
    stored["suites"], path = {}, arguments.out.resolve() / _name(machine)
    for name in arguments.suite:
        print(f"\n## {name}: {SUITES[name]}\n", flush=True)
        started = time.perf_counter()
        stored["suites"][name] = run_suite(name, options, machine["opencl"]["gpu"])
        print(_table(name, stored["suites"][name], options))
        print(f"\nMeasured in {time.perf_counter() - started:.0f} s.", flush=True)
        _write(path, stored)
    print(f"\nStored in {path}")
    if failed := [name for name, suite in stored["suites"].items() if "failed" in suite]:
        raise SystemExit(f"Failed: {', '.join(failed)}.")


def _machine_text(machine: dict[str, Any]) -> str:
    """Return the devices, the host and the commit in a line, since times depend on the host too."""
    devices = f"{machine['opencl']['device']}, {machine['opengl']['renderer']}"
    return f"{devices}; {machine['cores']} cores of {machine['processor']}; commit {machine['commit']}"


def run_suite(name: str, options: Options, gpu: bool) -> dict[str, Any]:
    """Run a suite; return its records, or the reason why there are none."""
    outcome = run_apart("benchmarks.run:records", {"name": name, "options": asdict(options)})
    if outcome.error:
        return {"failed": outcome.error}
    return {"records": [{"gpu": gpu, **record} for record in outcome.value], "seconds": outcome.seconds}


def records(name: str, options: dict[str, Any]) -> list[dict[str, Any]]:
    """Run a suite in this process."""
    return importlib.import_module(f"benchmarks.suites.{name}").run(Options(**options))


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    listed = "; ".join(f"{name}: {text}" for name, text in SUITES.items()).replace("%", "%%")
    parser.add_argument(
        "--suite", nargs="+", choices=SUITES, default=list(SUITES), metavar="NAME", help=listed
    )
    parser.add_argument("--gpu", action="store_true", help="sizes for a graphics card, which has to be there")
    parser.add_argument("--full", action="store_true", help="all sizes and scenes; may take hours")
    parser.add_argument("--scenes", type=Path, default=Path(Options.scenes), help="folder of scene files")
    parser.add_argument(
        "--scene",
        nargs="+",
        default=[],
        metavar="NAME",
        help="scenes of equal_error, or cases of large and levels such as 13M-64M and 13M-1M; all without",
    )
    parser.add_argument("--out", type=Path, default=Path(Options.results), help="folder for the figures")
    return parser.parse_args()


def _machine(gpu: bool) -> dict[str, Any]:
    """Return the facts of this machine; ends if a graphics card is wanted and OpenCL has none."""
    outcome = run_apart("benchmarks.machine:facts", {})
    if outcome.error:
        raise SystemExit(f"Nothing can be measured: {outcome.error}")
    if gpu and not outcome.value["opencl"]["gpu"]:
        raise SystemExit(
            f"--gpu measures a graphics card, but OpenCL offers only '{outcome.value['opencl']['device']}'. "
            "Install the card's driver, or leave --gpu out."
        )
    return outcome.value


def _table(name: str, suite: dict[str, Any], options: Options) -> str:
    """Return the tables of a suite."""
    if "failed" in suite:
        return f"Failed: {suite['failed']}"
    return importlib.import_module(f"benchmarks.suites.{name}").tables(suite["records"], options)


def _name(machine: dict[str, Any]) -> str:
    """Return the name of the file: date, kind and device."""
    device = re.sub(r"[^A-Za-z0-9]+", "-", machine["opencl"]["device"]).strip("-").lower()[:40].strip("-")
    kind, moment = "gpu" if machine["opencl"]["gpu"] else "cpu", re.sub(r"\D", "", machine["date"][:16])
    return f"{moment[:8]}-{moment[8:]}-{kind}-{device}.json"


def _write(path: Path, stored: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(_finite(stored), indent=1) + "\n", encoding="utf-8")


def _finite(value: Any) -> Any:
    """Return a value in which null replaces values that JSON cannot store."""
    if isinstance(value, dict):
        return {name: _finite(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    if isinstance(value, float):
        return float(f"{value:.6g}") if abs(value) < float("inf") else None
    return value


if __name__ == "__main__":
    main()
