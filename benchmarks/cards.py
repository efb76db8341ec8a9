"""Measures bakes of one room by one GPU and by all equal GPUs of this machine: time by stage, and bits.

    python benchmarks/cards.py [--bakes 2048x4096 4096x2048x4] [--triangles 262144] [--repeat 3] [--profile]

A bake is RESOLUTIONxRAYS, or RESOLUTIONxRAYSxGROUPS, where GROUPS is the width of texel groups. Bakes by one
and by all devices alternate after a first one of each, which builds programs; nothing is kept between them.
A machine without equal GPUs only bakes by one device.
--budget limits the visibility data of each device, GiB, so that both choose the same method.
"""

from __future__ import annotations

import argparse
import cProfile
import hashlib
import pstats
import statistics
import sys
import time
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.rooms import hilly_room
from benchmarks.tables import table
from engine import BakeResult, Scene, Settings, finished
from engine.device.cl_device import ComputeDevice
from engine.device.freed_memory import keep_freed_memory
from engine.device.peers import has_equals
from engine.session import Session
from engine.settings import ALL_DEVICES


def main() -> None:
    """Bake each size and print a table."""
    options = _parse()
    keep_freed_memory()
    schedulers = _schedulers()
    for bake in options.bakes:
        resolution, samples, *groups = map(int, bake.split("x"))
        scene = hilly_room(resolution, options.triangles)
        settings = Settings(
            resolution=resolution, samples=samples, visibility="rays", intermediates=False, hide_seams=False,
            patch_groups=groups[0] if groups else 0, memory_budget=round(options.budget * 2**30),
        )  # fmt: skip
        print(f"\n## {resolution}² × {samples} rays, groups {groups[0] if groups else 'automatic'}\n")
        _measure(scene, settings, schedulers, options.repeat, options.profile)


def _schedulers() -> dict[str, str]:
    """Return values of `Settings.scheduler` by row; a machine without equal GPUs has one."""
    compute = ComputeDevice()
    shares = has_equals(compute)
    compute.release()
    return {"one": "", "all": ALL_DEVICES} if shares else {"one": ""}


def _measure(
    scene: Scene, settings: Settings, schedulers: dict[str, str], repeat: int, profile: bool
) -> None:
    """Alternate bakes by one and by all devices; print medians by stage and the ratio."""
    session = Session()
    made: dict[str, list[tuple[float, BakeResult]]] = {name: [] for name in schedulers}
    for number in range(repeat + 1):
        for name, scheduler in schedulers.items():
            session.forget()
            began = time.perf_counter()
            result = finished(session.bake(scene, replace(settings, scheduler=scheduler)))
            if number:
                made[name].append((time.perf_counter() - began, result))
    for name, scheduler in schedulers.items() if profile else ():
        session.forget()
        with cProfile.Profile() as profiler:
            finished(session.bake(scene, replace(settings, scheduler=scheduler)))
        print(name)
        pstats.Stats(profiler).sort_stats("tottime").print_stats(30)
        pstats.Stats(profiler).sort_stats("cumulative").print_stats(70)
    session.close()
    print(_table(made))
    for name, bakes in made.items():
        report = bakes[-1][1].report
        print(f"{name}: {' '.join(report.reasons)} {report.iterations} iterations, {_digest(bakes[-1][1])}")


def _table(made: dict[str, list[tuple[float, BakeResult]]]) -> str:
    """Return median times of all stages by devices, and the ratio of the totals."""
    stages = list(made["one"][0][1].report.seconds)
    rows = []
    for name, bakes in made.items():
        times = [seconds for seconds, _ in bakes]
        of_stages = [
            statistics.median(result.report.seconds[stage] for _, result in bakes) for stage in stages
        ]
        rows.append((name, statistics.median(times), f"{min(times):.3g}–{max(times):.3g}", *of_stages))
    ratio = f"one / all = {rows[0][1] / rows[1][1]:.2f}" if len(rows) > 1 else "No other GPU is equal."
    return f"{table(('devices', 'total, s', 'spread, s', *stages), rows)}\n\n{ratio}"


def _digest(result: BakeResult) -> str:
    """Return a digest of the lightmaps."""
    return hashlib.sha256(result.image.tobytes()).hexdigest()[:16]


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bakes", nargs="+", default=["2048x4096", "4096x2048x4"], help="their sizes")
    parser.add_argument("--triangles", type=int, default=262144)
    parser.add_argument("--repeat", type=int, default=3, help="measured bakes by each number of devices")
    parser.add_argument("--budget", type=float, default=0.0, help="GiB of visibility data of each device")
    parser.add_argument("--profile", action="store_true", help="print a profile of a bake more of each")
    return parser.parse_args()


if __name__ == "__main__":
    main()
