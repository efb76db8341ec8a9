"""Measures the processor time that checkpoints add to a bake, for two intervals.

python -m benchmarks.checkpoints [--resolution 256] [--samples 2048] [--repeats 3]

A Cornell box, all kernels built, nothing kept of the bake before. An interval of 0 s writes as often as a
tenth of the time allows; bytes are those that the file system was given.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path

from benchmarks.rooms import cornell_box
from benchmarks.tables import table
from engine import Session, Settings, finished

#: Checkpoint space, bytes, and interval, s, by what they are called.
_WAYS = {"none": (0, 5.0), "every 5 s": (4 << 30, 5.0), "as often as may be": (4 << 30, 0.0)}


def main() -> None:
    """Print a row for each way; they take turns."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--resolution", type=int, default=256)
    parser.add_argument("--samples", type=int, default=2048, help="rays a patch")
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    scene, session = cornell_box(options.resolution), Session()
    rows: dict[str, list[tuple[float, float, float]]] = {name: [] for name in _WAYS}
    with tempfile.TemporaryDirectory() as folder:
        for repeat in range(options.repeats + 1):
            for name, (space, interval) in _WAYS.items():
                settings = Settings(
                    resolution=options.resolution, samples=options.samples, visibility="rays",
                    cache_dir=folder,
                    checkpoint_space=space, checkpoint_interval=interval, intermediates=False,
                )  # fmt: skip
                session.forget()
                began = time.process_time(), time.perf_counter(), _written()
                finished(session.bake(scene, settings))
                ended = time.process_time(), time.perf_counter(), _written()

                # The first bakes build kernels.
                if repeat:
                    rows[name].append(tuple(end - begin for begin, end in zip(began, ended, strict=True)))
    session.close()
    medians = {
        name: [statistics.median(column) for column in zip(*found, strict=True)]
        for name, found in rows.items()
    }
    usual = medians["none"][0]
    cells = [
        (name, cpu, f"{cpu / usual - 1:+.1%}", wall, written / 2**20)
        for name, (cpu, wall, written) in medians.items()
    ]
    print(table(("checkpoints", "processor, s", "more", "wall, s", "written, MiB"), cells))


def _written() -> int:
    """Return the bytes that this process has given to the file system; needs Linux."""
    lines = Path("/proc/self/io").read_text(encoding="ascii").splitlines()
    return int(next(line for line in lines if line.startswith("wchar")).split()[1])


if __name__ == "__main__":
    main()
