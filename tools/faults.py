"""Kills workers at random moments of bakes, compares the bits of the light, and counts repeated work.

    python tools/faults.py [--times 10] [--resolution 128] [--samples 256] [--stages Visibility Bounces ...]

Two workers with half of the processor each bake a room in squares of patches. In each stage one of them is
killed (SIGKILL) so many times, at moments spread over the stage's length in an undisturbed bake; another one
is started after the bake. Prints a table: of each stage how many bakes ended with the same bits, in how many
the worker was gone before the stage was over, the most blocks that were found anew and those that the killed
worker had held then, and how much longer than undisturbed ones bakes took. The exit code is 1 if a bake
differs, or finds more anew than was lost. All of it runs in a copy of the checkout, since workers of another
version are refused: files may be edited meanwhile.
"""

from __future__ import annotations

import argparse
import random
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Generator
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from benchmarks.rooms import panel_box
from engine import Settings
from engine.bake_result import BakeResult
from engine.cluster.local_workers import LocalWorkers
from engine.progress import Progress
from engine.session import Session

#: Half of the two processors that every machine has.
_HALF = {"POCL_MAX_PTHREAD_COUNT": "1"}

#: Stages of a bake, as its progress names them; all bounces are one. Workers have nothing to do any more when
#: images are made, and saved.
_STAGES = ("Direct light", "Visibility", "Bounces", "Final gather", "Supersampling", "Finishing lightmaps")

#: Of random moments.
_SEED = 20260811

#: Seconds that a new worker has to start.
_START = 120

#: The checkout, and what is needed of it.
_ROOT = Path(__file__).resolve().parents[1]
_NEEDED = ("benchmarks", "engine", "kernels", "shaders", "tests/analytic", "tests/reference", "tools")


@dataclass
class Trial:
    """Measurements of a bake.

    seconds:   that it took
    lengths:   s of its stages, by name
    found:     tasks that found what a block sees
    held:      blocks that a worker had which was killed
    in_stage:  whether one was killed before the stage was over
    """

    lightmap: BakeResult
    seconds: float
    lengths: dict[str, float]
    found: int
    held: int
    in_stage: bool


class Room:
    """A room that two workers bake, one of which may be killed."""

    def __init__(self, workers: LocalWorkers, resolution: int, samples: int) -> None:
        self._workers, self._client = workers, workers.client
        self._scene = panel_box(resolution)
        self._held: dict[str, int] = {}
        self._settings = Settings(
            resolution=resolution, samples=samples, visibility="rays", patch_groups=2, intermediates=False,
            scheduler=self._client.scheduler_info()["address"],
        )  # fmt: skip

    def bake(self, stage: str = "", delay: float = 0.0) -> Trial:
        """Bake; kill the last worker `delay` seconds after a stage has begun, then start a new one."""
        there, moment = self._addresses(), Moment(stage, delay, self._kill)
        began = time.time()
        lightmap, lengths = moment.watch(Session().bake(self._scene, self._settings))
        seconds = time.time() - began
        done = self._client.get_task_stream(start=began)
        found = sum(task["key"].startswith("find-") for task in done)
        killed = set[str]()
        while stage and not killed:
            killed = there - self._addresses()
        if killed:
            self._workers.add(_HALF)
            self._client.wait_for_workers(len(there), timeout=_START)
        held = sum(self._held[worker] for worker in killed)
        return Trial(lightmap, seconds, lengths, found, held, moment.in_stage)

    def _kill(self) -> None:
        """Kill the last worker; record the blocks of every worker."""
        had = self._client.has_what()
        self._held = {worker: sum(key.startswith("find-") for key in had[worker]) for worker in had}
        self._workers.kill(-1)

    def _addresses(self) -> set[str]:
        """Return the addresses of the workers that are there."""
        return set(self._client.scheduler_info(n_workers=-1)["workers"])


class Moment:
    """Moment at which a worker is killed: some seconds after a stage has begun, at the latest at its end.

    in_stage:  whether the moment came before the end
    """

    def __init__(self, stage: str, delay: float, strike: Callable[[], None]) -> None:
        self._stage, self._strike = stage, strike
        self._timer = threading.Timer(delay, strike)
        self.in_stage = False

    def watch(self, work: Generator[Progress, None, BakeResult]) -> tuple[BakeResult, dict[str, float]]:
        """Bake; return the lightmap, and s of each stage, by name."""
        lengths, last, began = dict[str, float](), "", time.time()
        while True:
            try:
                stage = next(work).stage
            except StopIteration as stop:
                self._ended(last)
                lightmap: BakeResult = stop.value
                return lightmap, lengths
            stage = "Bounces" if stage.startswith("Bounce") else stage
            lengths[stage] = lengths.get(stage, 0.0) + time.time() - began
            began = time.time()
            if stage != last:
                self._ended(last)
                if stage == self._stage:
                    self._timer.start()
                last = stage

    def _ended(self, stage: str) -> None:
        """Strike if the stage has ended before its moment came."""
        if not stage or stage != self._stage:
            return
        self.in_stage = not self._timer.is_alive()
        self._timer.cancel()
        self._timer.join()
        if not self.in_stage:
            self._strike()


def main() -> int:
    """Bake, in a copy of the checkout; print the table, and return the exit code."""
    options = _parser().parse_args()
    if options.here:
        return _measured(options)
    with tempfile.TemporaryDirectory() as folder:
        for part in _NEEDED:
            ignored = shutil.ignore_patterns("__pycache__", "results")
            shutil.copytree(_ROOT / part, Path(folder) / part, ignore=ignored)
        command = [sys.executable, str(Path(folder) / "tools" / "faults.py"), "--here", *sys.argv[1:]]
        return subprocess.run(command).returncode


def _measured(options: argparse.Namespace) -> int:
    """Bake; print the table, and return the exit code."""
    workers = LocalWorkers([_HALF] * 2)
    try:
        room = Room(workers, options.resolution, options.samples)
        room.bake()
        undisturbed = [room.bake() for _ in range(3)]
        print("undisturbed: " + ", ".join(f"{trial.seconds:.1f} s" for trial in undisturbed), flush=True)
        print("| killed in | same bits | in the stage | found anew, of held | longer by, s |\n|" + "---|" * 5)
        chance = random.Random(_SEED)
        rows = [_row(room, undisturbed, stage, options.times, chance) for stage in options.stages]
    finally:
        workers.close()
    return 0 if all(rows) else 1


def _row(room: Room, undisturbed: list[Trial], stage: str, times: int, chance: random.Random) -> bool:
    """Kill workers in a stage and print its row; return whether all went well."""
    length = min(trial.lengths[stage] for trial in undisturbed)
    trials = [room.bake(stage, chance.uniform(0, length)) for _ in range(times)]
    wanted, usual = undisturbed[0].lightmap.display, statistics.median(t.seconds for t in undisturbed)
    same = sum(np.array_equal(trial.lightmap.display, wanted) for trial in trials)
    anew = [(trial.found - undisturbed[0].found, trial.held) for trial in trials]
    longer = sorted(trial.seconds - usual for trial in trials)
    most, held = max(anew)
    print(
        f"| {stage} | {same} of {times} | {sum(trial.in_stage for trial in trials)} | {most} of {held} "
        f"| {longer[0]:.1f} to {longer[-1]:.1f} |",
        flush=True,
    )
    return same == times and all(found <= lost for found, lost in anew)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--times", type=int, default=10)
    parser.add_argument("--resolution", type=int, default=128)
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--here", action="store_true", help="in this checkout, not in a copy of it")
    parser.add_argument("--stages", nargs="+", choices=_STAGES, default=_STAGES)
    return parser


if __name__ == "__main__":
    sys.exit(main())
