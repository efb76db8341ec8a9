"""How fast lightmaps follow their scene: seconds from an edit to the first image, and to settled light.

python -m benchmarks.live [--resolution 128] [--quality preview] [--edits 9]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from engine import Changes, Light, Scene, Session, Settings, finished
from engine.live import Live
from engine.quality import QUALITIES
from engine.worker.memory import keep_freed_memory

from .rooms import cornell_box

#: Edits of each kind.
_EDITS = 9


def lamp(step: int) -> Light:
    """Return a lamp that goes round in the room."""
    place = np.array([1 + 0.4 * np.cos(step), 1 + 0.4 * np.sin(step), 1.2])
    return Light("Lamp", "point", place, np.eye(3), np.float32([8, 6, 4]), radius=0.05)


def brightened(scene: Scene, step: int) -> Changes:
    """Change what the light of the ceiling emits."""
    number, light = next((i, paint) for i, paint in enumerate(scene.materials) if paint.emission.any())
    return Changes(materials={number: replace(light, emission=light.emission * np.float32(0.9))})


def painted(scene: Scene, step: int) -> Changes:
    """Change the colour of the first material."""
    colour = np.float32([0.5, 0.7, 0.6]) * np.float32(1 + 0.03 * step)
    return Changes(materials={0: replace(scene.materials[0], reflectance=colour)})


EDITS: dict[str, Callable[[Scene, int], Changes]] = {
    "lamp": lambda scene, step: Changes(lights=(lamp(step),)),
    "emission": brightened,
    "colour": painted,
    "world": lambda scene, step: Changes(world=np.full(3, 0.05 * step, np.float32)),
}


def follow(live: Live) -> Iterator[float]:
    """Settle; yield the seconds to the first image, to the last sweep's, and to the finished lightmap."""
    started, first, last = time.perf_counter(), None, 0.0
    for progress in live.settle():
        if progress.intermediate is not None:
            last = time.perf_counter() - started
            first = first or last
    yield from (first or last, last, time.perf_counter() - started)


def main() -> None:
    """Print the median and the worst of each kind of edit."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--resolution", type=int, default=128)
    parser.add_argument("--quality", choices=list(QUALITIES), default="preview")
    parser.add_argument("--edits", type=int, default=_EDITS)
    options = parser.parse_args()
    keep_freed_memory()
    settings = Settings(resolution=options.resolution, **QUALITIES[options.quality].values)
    session = Session()
    live = session.live(cornell_box(options.resolution), settings)
    finished(live.settle())
    print("| edit | first image, s | settled, s | finished, s |\n|---|---|---|---|")
    for name, edit in EDITS.items():
        rows = []
        for step in range(options.edits + 1):
            live.update(edit(live.scene, step))
            rows.append(list(follow(live)))

        # The first of a kind may build kernels.
        times = np.array(rows[1:])
        figures = " | ".join(f"{np.median(column):.3f} (at most {column.max():.3f})" for column in times.T)
        print(f"| {name} | {figures} |", flush=True)
    if live.lightmap:
        report = live.lightmap.report
        print(f"{report.patches} patches, {report.samples} samples, {report.iterations} iterations")
    session.close()


if __name__ == "__main__":
    main()
