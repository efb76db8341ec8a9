"""Measures the first bake of a worker process: seconds from the click to the first light, and to the end.

python -m benchmarks.first_light [--resolution 512] [--wait 0 10] [--rounds 3]

Blender's panel starts the worker, and the click sends it the scene, here a Cornell box. Each round begins
with empty caches; a second worker then bakes with full ones. Times leave out Blender's part: unwrapping and
reading the scene, and drawing.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.driver_caches import driver_caches
from benchmarks.rooms import cornell_box
from benchmarks.tables import table
from engine import Scene, Settings
from engine.errors import WorkerError
from engine.quality import QUALITIES
from engine.worker.worker import Worker, bake_without_crashing_device

#: Names of the caches' states.
_STATES = "nothing cached", "kernels cached"

#: Interval between two steps of the worker, s, as by the timer of a window.
_INTERVAL = 0.05


@dataclass(frozen=True)
class FirstBake:
    """Times of a bake, s from the click.

    light:   the first lightmap
    end:     the finished lightmap
    stages:  begin of each stage, by name
    device:  device of the bake
    """

    light: float
    end: float
    stages: dict[str, float]
    device: str


def measure(scene: Scene, settings: Settings, wait: float) -> FirstBake:
    """Start a worker as Blender's panel does, wait, and bake.

    wait:  seconds between the panel and the click
    """
    worker = Worker()
    try:
        worker.prepare("engine.warm_up:warm_up", asdict(Settings(cache_dir=settings.cache_dir)))
        clicked = time.perf_counter() + wait
        while time.perf_counter() < clicked:
            worker.preparation()
            time.sleep(_INTERVAL)
        return _bake(worker, scene, settings)
    finally:
        worker.stop()


def _bake(worker: Worker, scene: Scene, settings: Settings) -> FirstBake:
    """Bake in a worker; raises WorkerError if no lightmap was shown before the end."""
    begin, light, stages = time.perf_counter(), 0.0, dict[str, float]()
    work = bake_without_crashing_device(worker, scene, settings, {})
    while True:
        try:
            progress = next(work)
        except StopIteration as end:
            device = ", ".join(end.value.report.devices.values())
            break
        now = time.perf_counter() - begin
        if progress is None:
            continue
        stages.setdefault(progress.stage.rstrip(" 0123456789of:"), now)
        if progress.intermediate is not None and not light:
            light = now
    if not light:
        raise WorkerError("The bake ended before it showed a lightmap.")
    return FirstBake(light, time.perf_counter() - begin, stages, device)


def main() -> None:
    """Print a table of all states of the caches, and the stages of the median bake of each."""
    arguments = _parse()
    scene = cornell_box(arguments.resolution)
    rows, notes, device = [], [], ""
    for wait in arguments.wait:
        rounds = [_round(scene, arguments.resolution, wait) for _ in range(arguments.rounds)]
        for state, bakes in zip(_STATES, zip(*rounds, strict=True), strict=True):
            rows.append((state, f"{wait:g}", *_spread([bake.light for bake in bakes]),
                         *_spread([bake.end for bake in bakes])))  # fmt: skip
            middle = sorted(bakes, key=lambda bake: bake.light)[len(bakes) // 2]
            begun = ", ".join(f"{name} {seconds:.2f}" for name, seconds in middle.stages.items())
            notes.append(f"{state}, wait {wait:g} s, first light {middle.light:.2f} s: {begun}")
            device = middle.device
    titles = ("caches", "wait, s", "first light, s", "spread, s", "end, s", "spread, s")
    print(f"{device}, {arguments.resolution}²\n\n{table(titles, rows)}\n\nBegin of the stages, s:\n")
    print("\n".join(notes))


def _round(scene: Scene, resolution: int, wait: float) -> tuple[FirstBake, FirstBake]:
    """Return two bakes by one worker process each: with empty caches, and with those of the first."""
    with tempfile.TemporaryDirectory(prefix="hemibake-bench-") as folder, driver_caches(folder):
        values = QUALITIES["preview"].values | {"resolution": resolution, "intermediates": True}
        settings = Settings(**values, centres=False, cache_dir=f"{folder}/hemibake")
        return measure(scene, settings, wait), measure(scene, settings, wait)


def _spread(seconds: Sequence[float]) -> tuple[float, str]:
    """Return the median, and the fastest and the slowest, s."""
    return statistics.median(seconds), f"{min(seconds):.3g}–{max(seconds):.3g}"


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--resolution", type=int, default=512, help="width of the lightmap, texels")
    parser.add_argument(
        "--wait", type=float, nargs="+", default=[0.0, 10.0], help="seconds from the panel to the click"
    )
    parser.add_argument("--rounds", type=int, default=3, help="bakes with each state of the caches")
    return parser.parse_args()


if __name__ == "__main__":
    main()
