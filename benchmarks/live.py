"""Measures Live: seconds from an edit to the first image and to convergence.

python -m benchmarks.live [--resolution 128] [--quality preview] [--edits 9] [--triangles 40000] [--processor]
python -m benchmarks.live --resolution 1024 --rays 16 --host [--results FILE.json]
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from engine import Light, Scene, SceneChanges, Session, Settings, finished
from engine.device.freed_memory import keep_freed_memory
from engine.live import Live
from engine.quality import QUALITIES

from .machine import facts
from .rooms import cornell_box, hilly_room, with_small_box

#: Edits of each kind.
_EDITS = 9

#: Measured times of each edit, from its start.
_TIMES = ("first image", "settled", "finished")


def lamp(step: int) -> Light:
    """Return a lamp that goes round in the room."""
    place = np.array([1 + 0.4 * np.cos(step), 1 + 0.4 * np.sin(step), 1.2])
    return Light("Lamp", "point", place, np.eye(3), np.float32([8, 6, 4]), radius=0.05)


def brightened(scene: Scene, step: int) -> SceneChanges:
    """Change the emission of the ceiling light."""
    number, light = next((i, paint) for i, paint in enumerate(scene.materials) if paint.emission.any())
    return SceneChanges(materials={number: replace(light, emission=light.emission * np.float32(0.9))})


def painted(scene: Scene, step: int) -> SceneChanges:
    """Change the colour of the first material."""
    colour = np.float32([0.5, 0.7, 0.6]) * np.float32(1 + 0.03 * step)
    return SceneChanges(materials={0: replace(scene.materials[0], reflectance=colour)})


def pushed(scene: Scene, step: int) -> SceneChanges:
    """Move the small box, the last mesh, to and fro."""
    matrix = np.eye(4)
    matrix[:3, 3] = np.array([0.03, 0.02, 0.01]) * (step % 3 + 1) * (-1) ** step
    return SceneChanges(moves={len(scene.meshes) - 1: matrix})


EDITS: dict[str, Callable[[Scene, int], SceneChanges]] = {
    "lamp": lambda scene, step: SceneChanges(lights=(lamp(step),)),
    "emission": brightened,
    "colour": painted,
    "world": lambda scene, step: SceneChanges(world=np.full(3, 0.05 * step, np.float32)),
    "move": pushed,
}


def follow(live: Live, clock: Callable[[], float]) -> Iterator[float]:
    """Settle; yield the seconds to the first image, to the last sweep's, and to the finished lightmap."""
    started, first, last = clock(), None, 0.0
    for progress in live.converge():
        if progress.intermediate is not None:
            last = clock() - started
            first = first or last
    yield from (first or last, last, clock() - started)


def main() -> None:
    """Print the median and the worst of each kind of edit."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--resolution", type=int, default=128)
    parser.add_argument("--quality", choices=list(QUALITIES), default="preview")
    parser.add_argument("--edits", type=int, default=_EDITS)
    parser.add_argument("--only", choices=list(EDITS), help="this kind of edit alone")
    parser.add_argument("--triangles", type=int, default=0, help="a room with hills of so many, not a box")
    parser.add_argument("--rays", type=int, default=0, help="of each patch; few leave the host's work alone")
    clocks = parser.add_mutually_exclusive_group()
    clocks.add_argument("--processor", action="store_true", help="time of processors, not of a clock")
    clocks.add_argument(
        "--host", action="store_true", help="processor time of the thread that starts kernels"
    )
    parser.add_argument("--results", type=Path, help="a JSON file for the figures, and the machine's")
    options = parser.parse_args()
    keep_freed_memory()
    settings = Settings(resolution=options.resolution, **QUALITIES[options.quality].values)
    if options.rays:
        settings = replace(settings, samples=options.rays, light_samples=1)
    session, width = Session(), options.resolution
    clock = (
        time.process_time if options.processor else time.thread_time if options.host else time.perf_counter
    )
    room = hilly_room(width, options.triangles) if options.triangles else cornell_box(width)
    live = session.live(with_small_box(room, width), settings)
    finished(live.converge())
    print("| edit | first image, s | settled, s | finished, s |\n|---|---|---|---|")
    records = []
    for name in [options.only] if options.only else EDITS:
        rows = []
        for step in range(options.edits + 1):
            live.update(EDITS[name](live.scene, step))
            rows.append(list(follow(live, clock)))

        # The first of a kind may build kernels.
        times = np.array(rows[1:])
        figures = " | ".join(f"{np.median(column):.3f} (at most {column.max():.3f})" for column in times.T)
        print(f"| {name} | {figures} |", flush=True)
        columns = zip(_TIMES, times.T, strict=True)
        records.append({"edit": name} | {time: column.tolist() for time, column in columns})
    if live.lightmap:
        report = live.lightmap.report
        print(f"{report.patches} patches, {report.samples} samples, {report.iterations} iterations")
    session.close()
    if options.results:
        chosen = {name: value for name, value in vars(options).items() if name != "results"}
        made = {"machine": facts(), "options": chosen, "seconds": records}
        options.results.write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
