r"""Measures bakes of one room with 0, 1, 2, ... workers: time by stage, traffic, device memory.

On a machine with two graphics cards one call measures a bake whose patches are solved one by one, and one of
16 M texels in squares:

    python benchmarks/cluster.py --devices H200 --triangles 262144 --workers 0 1 2 \
        --bakes 2048x4096 4096x2048x4 --results FILE.json

A bake is RESOLUTIONxRAYS, or RESOLUTIONxRAYSxGROUPS, where GROUPS is the width of the squares. Without
graphics cards workers share the processor, and have --threads each. Each number of workers bakes twice:
programs are built in the first bake, by another seed, and the second one is told, with a table: of each stage
its wall time on the client, how long no worker was busy in it, and how long each worker was. Results are
added to those of the file; benchmarks/cost_model.py reads them.
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
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from distributed.utils import key_split

from benchmarks.rooms import hilly_room
from engine import Settings
from engine.bake_result import BakeResult
from engine.cluster.local_workers import LocalWorkers, local_environments
from engine.device.freed_memory import keep_freed_memory
from engine.progress import Progress
from engine.scene.model import Scene
from engine.session import Session

#: Seeds of the first bake, which builds programs, and of the measured bake.
_SEEDS = (1, 0)

#: Seconds between two looks at the memory of cards.
_PAUSE = 0.2

#: Shorter stages are not told, s.
_MOMENT = 5e-4


@dataclass(frozen=True)
class _Size:
    """Size of a bake: texels per side, rays per patch, and width of the patch groups."""

    resolution: int
    samples: int
    groups: int = 1

    @classmethod
    def of(cls, text: str) -> _Size:
        """Read such as 2048x4096 or 4096x2048x4."""
        return cls(*map(int, text.split("x")))


def main() -> None:
    """Bake with each number of workers; print and store the measurements."""
    options = _parser().parse_args()
    keep_freed_memory()
    for size in options.bakes:
        scene = hilly_room(size.resolution, options.triangles)
        settings = Settings(
            resolution=size.resolution, samples=size.samples, texel_samples=options.texel_samples,
            visibility="rays", intermediates=False, hide_seams=False, patch_groups=size.groups,
            light_samples=options.light_samples,
        )  # fmt: skip
        for count in options.workers:
            by_workers = (count, options.threads)
            measured = _by_workers(scene, settings, *by_workers) if count else _alone(scene, settings)
            room = {"triangles": options.triangles, "texels": size.resolution**2}
            kind = {"devices": options.devices, "groups": size.groups, "workers": count}
            record = {**kind, **room, **measured}
            _print_stages(record["by_stage"])
            print(json.dumps(record), flush=True)
            if options.results:
                _add(options.results, record)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bakes", type=_Size.of, nargs="+", default=[_Size(128, 256)], help="their sizes")
    parser.add_argument("--triangles", type=int, default=2000)
    parser.add_argument("--texel-samples", type=int, default=4)
    parser.add_argument("--light-samples", type=int, default=Settings().light_samples)
    parser.add_argument("--workers", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--threads", type=int, help="of each worker on a processor")
    parser.add_argument("--devices", default="processor", help="what they are, for the record")
    parser.add_argument("--results", type=Path, help="a JSON file")
    return parser


@dataclass
class _Span:
    """A part of a bake: the stage it belongs to, and when it began and ended, s since 1970."""

    stage: str
    began: float
    ended: float


def _timed(work: Generator[Progress, None, BakeResult]) -> tuple[BakeResult, list[_Span]]:
    """Bake; return the lightmap and the stages, one after the other."""
    spans = [_Span("Starting", time.time(), time.time())]
    while True:
        try:
            stage = next(work).stage
        except StopIteration as stop:
            spans[-1].ended = time.time()
            lightmap: BakeResult = stop.value
            return lightmap, spans

        # What is told belongs to the stage that it tells of: it comes when a part of it is done, or begins.
        stage, now = "Bounces" if stage.startswith("Bounce") else stage, time.time()
        if stage == spans[-1].stage:
            spans[-1].ended = now
        else:
            spans.append(_Span(stage, spans[-1].ended, now))


def _alone(scene: Scene, settings: Settings) -> dict[str, Any]:
    """Bake without workers."""
    lightmap, spans, held = _second(scene, settings)
    by_stage = _by_stage(spans, {})
    return _bake(lightmap, spans, by_stage) | {"held_bytes": held, "host_bytes": [_host_bytes()]}


def _second(scene: Scene, settings: Settings) -> tuple[BakeResult, list[_Span], list[int]]:
    """Bake twice in one session, which keeps programs, but nothing of the scene.

    Returns the second lightmap, its stages, and the most memory of each graphics card in it, bytes.
    """
    session = Session()
    for seed in _SEEDS:
        session.forget()
        with _Held() as held:
            lightmap, spans = _timed(session.bake(scene, replace(settings, seed=seed)))
    session.close()
    return lightmap, spans, held.most


def _by_workers(scene: Scene, settings: Settings, count: int, threads: int | None) -> dict[str, Any]:
    """Bake with workers that are running; return the measurements, including those of the tasks."""
    environments = local_environments()
    if threads:
        environments = [{"POCL_MAX_PTHREAD_COUNT": str(threads)}] * count
    print("workers", environments[:count], flush=True)
    workers = LocalWorkers(environments[:count])
    try:
        client = workers.client
        settings = replace(settings, scheduler=client.scheduler_info()["address"])
        client.get_task_stream(count=0)
        lightmap, spans, held = _second(scene, settings)
        hosts = [_host_bytes(), *client.run(_host_bytes).values()]
        done = client.get_task_stream(start=spans[0].began)
        told = _bake(lightmap, spans, _by_stage(spans, _busy(done)))
        return told | {"tasks": _tasks(done), "held_bytes": held, "host_bytes": hosts}
    finally:
        workers.close()


def _bake(lightmap: BakeResult, spans: Sequence[_Span], by_stage: Mapping[str, Any]) -> dict[str, Any]:
    """Return the measurements that are common to all bakes."""
    report = lightmap.report
    return {
        "patches": report.patches,
        "samples": report.samples,
        "sweeps": report.iterations,
        "points": sum(map(_points, report.reasons)),
        "seconds": round(spans[-1].ended - spans[0].began, 3),
        "by_stage": by_stage,
        "stages": {name: round(value, 3) for name, value in report.seconds.items()},
        "digest": hashlib.sha256(lightmap.image.tobytes()).hexdigest()[:16],
    }


def _points(reason: str) -> int:
    """Return the number of sample points per texel from a reason of the report; 0 without one."""
    told = re.search(r"gathered at ([\d,]+) more points", reason)
    return int(told[1].replace(",", "")) if told else 0


Intervals = list[tuple[float, float]]


def _busy(done: Sequence[Mapping[str, Any]]) -> dict[str, Intervals]:
    """Return of each worker when it was busy with a task, s since 1970."""
    busy: dict[str, Intervals] = {}
    for task in done:
        steps = (step for step in task["startstops"] if step["action"] == "compute")
        busy.setdefault(task["worker"], []).extend((step["start"], step["stop"]) for step in steps)
    return {worker: sorted(busy[worker]) for worker in sorted(busy)}


def _by_stage(spans: Sequence[_Span], busy: Mapping[str, Intervals]) -> dict[str, dict[str, Any]]:
    """Return the busy seconds of client and workers in each stage, and the seconds in which none was busy."""
    stages: dict[str, dict[str, Any]] = {}
    every = sorted(interval for intervals in busy.values() for interval in intervals)
    for span in spans:
        stage = stages.setdefault(span.stage, {"client": 0.0, "nobody": 0.0, "workers": [0.0] * len(busy)})
        seconds = span.ended - span.began
        stage["client"] += seconds
        stage["nobody"] += seconds - _covered(span, every)
        stage["workers"] = [
            before + _covered(span, own) for before, own in zip(stage["workers"], busy.values(), strict=True)
        ]
    return {
        name: {
            "client": round(stage["client"], 3),
            "nobody": round(stage["nobody"], 3),
            "workers": [round(seconds, 3) for seconds in stage["workers"]],
        }
        for name, stage in stages.items()
        if stage["client"] > _MOMENT
    }


def _covered(span: _Span, intervals: Intervals) -> float:
    """Return the seconds of a span that lie in any of some intervals, ordered by their beginning."""
    covered, end = 0.0, span.began
    for first, last in intervals:
        first, last = max(first, end), min(last, span.ended)
        covered, end = covered + max(last - first, 0.0), max(end, last)
    return covered


def _print_stages(stages: Mapping[str, Mapping[str, Any]]) -> None:
    """Print the table of `_by_stage`."""
    for name, stage in stages.items():
        workers = "".join(f"{seconds:9.3f}" for seconds in stage["workers"])
        print(f"{name:20}{stage['client']:9.3f} s, no worker busy{stage['nobody']:9.3f}, busy{workers}")


def _tasks(done: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """Return of each kind of task how many there were and, of all workers, their seconds and bytes.

    compute:   seconds that all tasks took, and the longest
    transfer:  seconds in which workers fetched what they needed, as part of no task
    bytes:     of the results
    """
    kinds: dict[str, dict[str, float]] = {}
    for task in done:
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
    """Measures the used memory of each NVIDIA card while it is open.

    most:  bytes; empty without NVIDIA's tool
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
