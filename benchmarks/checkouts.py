"""Compares bakes by the engines of two checkouts on one machine.

    python benchmarks/checkouts.py BEFORE [AFTER] [--rounds 2] [--quality NAME ...] [--arrays BEFORE AFTER]

BEFORE and AFTER are folders of checkouts; AFTER is this one unless it is given. Each round measures both in
processes of their own: the Cornell box at 1024² and the hall at 2048², warm, relit, and once in *Very High*.
--arrays adds the living room at 1024²: two folders that `benchmarks.scene_arrays` of each checkout has made.
Times are medians of all rounds.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Collection
from pathlib import Path
from runpy import run_path
from typing import Any

_ROOT = Path(__file__).resolve().parents[1]

#: Scene, width of the lightmap, quality, and number of bakes in a round.
_CASES = (
    ("box", 1024, "high", 5), ("box", 1024, "preview", 5), ("hall", 2048, "preview", 3),
    ("hall", 2048, "high", 2), ("hall", 2048, "very_high", 0),
    ("living_room", 1024, "preview", 5), ("living_room", 1024, "high", 5),
)  # fmt: skip


def main() -> None:
    """Measure both checkouts and print a table."""
    options = _parse()
    if options.measure:
        folder, *arrays = options.measure
        print(json.dumps(_measured(folder, options.quality, *arrays)))
        return
    times: dict[str, tuple[list[float], list[float]]] = defaultdict(lambda: ([], []))
    for _ in range(options.rounds):
        for side, folder in enumerate((options.before, options.after)):
            measured = [folder, options.arrays[side]] if options.arrays else [folder]
            command = [sys.executable, __file__, str(folder), "--measure", *map(str, measured)]
            command += ["--quality", *options.quality]
            printed = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
            for name, seconds in json.loads(printed.splitlines()[-1]).items():
                times[name][side].extend(seconds)
    sys.path.insert(0, str(_ROOT))
    from benchmarks.tables import table

    rows = []
    for name, sides in times.items():
        before, after = map(statistics.median, sides)
        spread = f"{min(sides[1]):.3g}–{max(sides[1]):.3g}"
        rows.append((name, before, after, spread, f"{before / after:.2f}×"))
    print(table(("bake", "before, s", "after, s", "spread, s", "speed"), rows))


def _measured(folder: Path, qualities: Collection[str], arrays: Path | None = None) -> dict[str, list[float]]:
    """Bake the cases of some qualities with the engine of a checkout; return the times in seconds by name.

    arrays:  folder of stored scenes; None to leave them out
    """
    sys.path[0] = str(folder.resolve())
    from benchmarks.configurations import settings
    from benchmarks.halls import hall
    from benchmarks.rooms import cornell_box
    from engine.device.freed_memory import keep_freed_memory
    from engine.quality import QUALITIES
    from engine.session import Session

    keep_freed_memory()
    makers: dict[str, Any] = {"box": cornell_box, "hall": hall}
    if arrays:
        stored_scene = run_path(str(_ROOT / "benchmarks" / "stored_scenes.py"))["stored_scene"]
        makers["living_room"] = lambda _: stored_scene(arrays.resolve(), "living_room")
    times: dict[str, list[float]] = {}
    session = Session()
    for scene_name, resolution, quality, repeats in _CASES:
        if scene_name not in makers or quality not in qualities:
            continue
        scene = makers[scene_name](resolution)
        chosen = settings(dict(QUALITIES[quality].values), resolution=resolution)
        name = f"{scene_name} {resolution}², {quality}"
        if repeats:
            _bake(session, scene, chosen)
        session.forget()
        times[name] = []
        for _ in range(repeats or 1):
            session.forget()
            times[name].append(_bake(session, scene, chosen))
        if quality == "high":
            relit = [_bake(session, _relit(scene, turn), chosen) for turn in range(repeats)]
            times[f"{name}, relit"] = relit
    session.close()
    return times


def _bake(session: Any, scene: Any, chosen: Any) -> float:
    """Bake; return the time, s."""
    from engine import finished

    began = time.perf_counter()
    finished(session.bake(scene, chosen))
    return time.perf_counter() - began


def _relit(scene: Any, turn: int) -> Any:
    """Return a scene whose first light, or without lights whose surfaces, emit another strength."""
    from dataclasses import replace

    factor = 1.25 if turn % 2 else 0.8
    if scene.lights:
        first = replace(scene.lights[0], strength=scene.lights[0].strength * factor)
        return replace(scene, lights=(first, *scene.lights[1:]))
    brighter = [replace(made, emission=made.emission * factor) for made in scene.materials]
    return replace(scene, materials=tuple(brighter))


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("before", type=Path, help="folder of a checkout")
    parser.add_argument("after", type=Path, nargs="?", default=_ROOT, help="folder of another; else this one")
    parser.add_argument("--rounds", type=int, default=2, help="measurements of each")
    named = sorted({quality for _, _, quality, _ in _CASES})
    parser.add_argument(
        "--quality", nargs="+", default=named, choices=named, help="qualities that are measured"
    )
    parser.add_argument(
        "--arrays",
        type=Path,
        nargs=2,
        metavar=("BEFORE", "AFTER"),
        help="folders of stored scenes, of BEFORE and of AFTER",
    )
    parser.add_argument("--measure", type=Path, nargs="+", help=argparse.SUPPRESS)
    return parser.parse_args()


if __name__ == "__main__":
    main()
