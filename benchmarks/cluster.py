"""Bakes of one room by no workers, one, two, ...: where the time goes, what travels, what each device holds.

    python benchmarks/cluster.py --resolution 2048 --samples 2048 --workers 0 1 2 --results FILE.json

Without graphics cards workers share the processor, and have --threads each. Each number of workers bakes
twice: programs are built in the first bake, by another seed, and the second one is told. Results are added to
those of the file; benchmarks/cost_model.py reads them.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from distributed import Client
from distributed.utils import key_split

from benchmarks.rooms import hilly_room
from engine import Settings
from engine.cluster.local_workers import LocalWorkers, local_environments
from engine.lightmap import Lightmap
from engine.progress import finished
from engine.scene.model import Scene
from engine.session import Session

#: Of the bake that builds programs, and of the one that is told.
_SEEDS = (1, 0)

#: Seconds between two looks at the memory of cards.
_PAUSE = 0.2


def main() -> None:
    """Bake with each number of workers; print and keep what was measured."""
    options = _parser().parse_args()
    scene = hilly_room(options.resolution, options.triangles)
    settings = Settings(
        resolution=options.resolution, samples=options.samples, texel_samples=options.texel_samples,
        visibility="rays", intermediates=False, hide_seams=False, patch_groups=options.patch_groups,
    )  # fmt: skip
    for count in options.workers:
        by_workers = (count, options.threads)
        measured = _by_workers(scene, settings, *by_workers) if count else _alone(scene, settings)
        room = {"triangles": options.triangles, "texels": options.resolution**2}
        kind = {"devices": options.devices, "groups": options.patch_groups, "workers": count}
        record = {**kind, **room, **measured}
        print(json.dumps(record), flush=True)
        if options.results:
            _add(options.results, record)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--resolution", type=int, default=128)
    parser.add_argument("--triangles", type=int, default=2000)
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--texel-samples", type=int, default=4)
    parser.add_argument("--patch-groups", type=int, default=1)
    parser.add_argument("--workers", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--threads", type=int, help="of each worker on a processor")
    parser.add_argument("--devices", default="processor", help="what they are, for the record")
    parser.add_argument("--results", type=Path, help="a JSON file")
    return parser


def _alone(scene: Scene, settings: Settings) -> dict[str, Any]:
    """Bake without workers, with a new session each time, so that nothing is kept."""
    for seed in _SEEDS:
        with _Held() as held:
            began = time.perf_counter()
            lightmap = finished(Session().bake(scene, replace(settings, seed=seed)))
            seconds = time.perf_counter() - began
    return _bake(lightmap, seconds) | {"held_bytes": held.most, "host_bytes": [_host_bytes()]}


def _by_workers(scene: Scene, settings: Settings, count: int, threads: int | None) -> dict[str, Any]:
    """Bake with workers that run already; return what tasks took, too."""
    environments = local_environments()
    if threads:
        environments = [{"POCL_MAX_PTHREAD_COUNT": str(threads)}] * count
    print("workers", environments[:count], flush=True)
    workers = LocalWorkers(environments[:count])
    try:
        client = workers.client
        settings = replace(settings, scheduler=client.scheduler_info()["address"])
        client.get_task_stream(count=0)
        for seed in _SEEDS:
            with _Held() as held:
                started, began = time.time(), time.perf_counter()
                lightmap = finished(Session().bake(scene, replace(settings, seed=seed)))
                seconds = time.perf_counter() - began
        hosts = [_host_bytes(), *client.run(_host_bytes).values()]
        tasks = _tasks(client, started)
        return _bake(lightmap, seconds) | {"tasks": tasks, "held_bytes": held.most, "host_bytes": hosts}
    finally:
        workers.close()


def _bake(lightmap: Lightmap, seconds: float) -> dict[str, Any]:
    """Return what every bake tells."""
    report = lightmap.report
    return {
        "patches": report.patches,
        "samples": report.samples,
        "sweeps": report.iterations,
        "points": sum(map(_points, report.reasons)),
        "seconds": round(seconds, 3),
        "stages": {name: round(value, 3) for name, value in report.seconds.items()},
        "digest": hashlib.sha256(lightmap.image.tobytes()).hexdigest()[:16],
    }


def _points(reason: str) -> int:
    """Return at how many points of texels light was gathered if a reason of a report tells it, else 0."""
    told = re.search(r"gathered at ([\d,]+) more points", reason)
    return int(told[1].replace(",", "")) if told else 0


def _tasks(client: Client, started: float) -> dict[str, dict[str, float]]:
    """Return of each kind of task how many there were and, of all workers, their seconds and bytes.

    compute   seconds that all tasks took, and the longest
    transfer  seconds in which workers fetched what they needed, as part of no task
    bytes     of the results
    """
    kinds: dict[str, dict[str, float]] = {}
    for task in client.get_task_stream(start=started):
        kind = kinds.setdefault(
            key_split(task["key"]), {"tasks": 0, "compute": 0.0, "longest": 0.0, "transfer": 0.0, "bytes": 0}
        )
        kind["tasks"] += 1
        kind["bytes"] += task.get("nbytes", 0)
        for step in task["startstops"]:
            took = step["stop"] - step["start"]
            if step["action"] in ("compute", "transfer"):
                kind[step["action"]] += took
            if step["action"] == "compute":
                kind["longest"] = max(kind["longest"], took)
    return {kind: {name: round(value, 4) for name, value in of.items()} for kind, of in kinds.items()}


def _host_bytes() -> int:
    """Return the most memory that this process has had so far, bytes."""
    told = Path("/proc/self/status").read_text()
    return int(re.search(r"VmHWM:\s+(\d+) kB", told)[1]) * 1024


class _Held:
    """Looks, while it is open, what memory is used of each graphics card of NVIDIA's.

    most  bytes; empty without NVIDIA's tool
    """

    def __init__(self) -> None:
        self.most: list[int] = []
        self._ended = threading.Event()

    def __enter__(self) -> _Held:
        self._thread = threading.Thread(target=self._look)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _look(self) -> None:
        command = ["nvidia-smi", "--query-gpu=memory.used", "--format=csv,noheader,nounits"]
        while shutil.which(command[0]) and not self._ended.wait(_PAUSE):
            said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
            used = [int(line) << 20 for line in said.split()]
            self.most = [max(pair) for pair in zip(used, self.most or used, strict=True)]


def _add(path: Path, record: Mapping[str, Any]) -> None:
    """Add a record to the list of a JSON file."""
    records = json.loads(path.read_text()) if path.exists() else []
    path.write_text(json.dumps([*records, record], indent=1) + "\n")


if __name__ == "__main__":
    main()
