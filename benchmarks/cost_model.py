"""Cost model of bakes on many devices: constants fitted to stored results, and predictions.

    python benchmarks/cost_model.py benchmarks/results/cluster.json [--devices H200] [--left-out 3]
    python benchmarks/cost_model.py benchmarks/results/cluster.json --patches 1e9 --workers 1000 --groups 4

Time is a sum of terms, each a constant times a number that a bake's size tells. Of tasks the seconds of all
workers together are fitted, which W workers share; of the client, and of what travels, its own. Constants are
not negative: least squares with those that would be left out (Lawson and Hanson 1974, active set).
"""

from __future__ import annotations

import argparse
import heapq
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from engine.cluster.blocks import Span, cut

#: Points of texels in a task, at least; see engine/cluster/cluster_devices.py.
_FEWEST_POINTS = 2048

#: Points of texels at most; see engine/postprocess/texel_samples.py.
_MOST_POINTS = 1 << 22

#: Bytes of a patch: its radiance on the way to a worker, its light on the way back, a kept sample, itself.
SENT, RETURNED, SAMPLE, ROW = 6, 12, 4, 20

#: Bytes of a patch in the process of each worker, and those that workers share: of 3.4 M patches in squares,
#: by one worker and by two, on a processor, whose memory holds the device's buffers, too.
HOST, HOST_SHARED = 69, 80

Record = dict[str, Any]


@dataclass(frozen=True)
class Size:
    """Size of a bake.

    patches:  that show light
    solved:   patches, or groups of them, that bounces are solved for
    points:   of texels that show more than their centre; 0 where that was not recorded
    """

    patches: float
    solved: float
    points: float
    triangles: float
    samples: float
    sweeps: float
    workers: float

    @classmethod
    def of(cls, record: Record) -> Size:
        """Return the size of a bake that was measured."""
        patches, points = record["patches"], record.get("points", 0)
        others = (record[name] for name in ("triangles", "samples", "sweeps", "workers"))
        return cls(patches, patches / record["groups"] ** 2, points, *others)

    @property
    def grouped(self) -> float:
        """Patches that are solved in groups, and gather once more at last."""
        return self.patches if self.solved < self.patches else 0.0

    def share(self, blocks: Sequence[Span]) -> float:
        """Return the part of some blocks that one worker has, if each takes the next when it is done.

        It is that of the worker that ends last.
        """
        taken = [0] * int(self.workers)
        for first, last in blocks:
            heapq.heapreplace(taken, taken[0] + last - first)
        return max(taken) / blocks[-1][1]


def _blocks(size: Size) -> list[Span]:
    """Return the blocks into which the solved patches are divided."""
    return cut(int(np.ceil(size.solved)))


def _final_blocks(size: Size) -> list[Span]:
    """Return the blocks of the patches."""
    return cut(int(size.patches))


def _point_blocks(size: Size) -> list[Span]:
    """Return the blocks of points of texels."""
    return cut(max(int(size.points), 1), _FEWEST_POINTS)


@dataclass(frozen=True)
class Part:
    """Part of a bake's time.

    seconds:  that a record tells of it
    terms:    numbers that it grows with, by what they are
    blocks:   that workers share, a task for each; None if the client takes it
    """

    name: str
    seconds: Callable[[Record], float]
    terms: dict[str, Callable[[Size], float]]
    blocks: Callable[[Size], list[Span]] | None = None


def _task(kind: str) -> Callable[[Record], float]:
    """Return the seconds of tasks of a kind; those to shared memory end in _to."""
    return lambda record: sum(
        record["tasks"][name]["compute"] for name in (kind, f"{kind}_to") if name in record["tasks"]
    )


def _rest(stage: str, *kinds: str) -> Callable[[Record], float]:
    """Return a function of a record: the seconds of a stage without its tasks, which workers share."""
    return lambda record: (
        record["stages"][stage] - sum(_task(kind)(record) for kind in kinds) / record["workers"]
    )


PARTS = (
    Part("patches", lambda record: record["stages"]["patches"],
         {"patch": lambda size: size.patches, "triangle": lambda size: size.triangles}),
    Part("shadow rays", _task("sampled"),
         {"patch": lambda size: size.patches, "block": lambda size: len(_final_blocks(size))}, _final_blocks),
    Part("shadow rays, client and way", _rest("direct", "sampled"),
         {"patch": lambda size: size.patches, "block": lambda size: len(_final_blocks(size))}),
    Part("finding", _task("find"),
         {"ray": lambda size: size.solved * size.samples, "block": lambda size: len(_blocks(size))}, _blocks),
    Part("sweeps", _task("gather"),
         {"sample": lambda size: size.solved * size.samples * size.sweeps,
          "block": lambda size: len(_blocks(size)) * size.sweeps}, _blocks),
    Part("last gather", _task("final"), {"ray": lambda size: size.grouped * size.samples}, _final_blocks),
    Part("squares and bounces, client and way", _rest("hemicubes", "find", "gather", "final"),
         {"patch in squares": lambda size: size.grouped,
          "patch and sweep": lambda size: size.solved * size.sweeps,
          "block and sweep": lambda size: len(_blocks(size)) * (size.sweeps + 1)}),
    Part("points of texels", _task("light_at_samples"),
         {"ray": lambda size: size.points * size.samples,
          "block": lambda size: len(_point_blocks(size))}, _point_blocks),
    Part("points of texels, client and way", _rest("texels", "light_at_samples"),
         {"patch": lambda size: size.patches, "point": lambda size: size.points}),
    Part("images", lambda record: record["stages"]["outputs"], {"patch": lambda size: size.patches}),
)  # fmt: skip


def fitted(part: Part, records: Sequence[Record]) -> np.ndarray:
    """Return the constants of a part's terms, not negative, least squares of relative errors."""
    rows = np.array([[term(Size.of(record)) for term in part.terms.values()] for record in records])
    seconds = np.array([max(part.seconds(record), 0.0) for record in records])
    scale = 1 / np.maximum(seconds, 1e-3)
    return _not_negative(rows * scale[:, None], seconds * scale)


def _not_negative(rows: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the least squares solution without negative entries: the best of all sets of columns."""
    count = rows.shape[1]
    best, error = np.zeros(count), float((values**2).sum())
    for chosen in range(1, 1 << count):
        columns = [column for column in range(count) if chosen >> column & 1]
        found = np.linalg.lstsq(rows[:, columns], values, rcond=None)[0]
        left = float(((rows[:, columns] @ found - values) ** 2).sum())
        if (found >= 0).all() and left < error:
            best, error = np.zeros(count), left
            best[columns] = found
    return best


class CostModel:
    """Seconds of bakes, by parts."""

    def __init__(self, records: Sequence[Record]) -> None:
        """Fit bakes by workers."""
        self.constants = {part.name: fitted(part, records) for part in PARTS}

    def seconds(self, size: Size) -> dict[str, float]:
        """Return the seconds that each part of a bake takes, as the client waits for it."""
        return {part.name: self._of(part, size) for part in PARTS}

    def _of(self, part: Part, size: Size) -> float:
        all_together = sum(
            constant * term(size)
            for constant, term in zip(self.constants[part.name], part.terms.values(), strict=True)
        )
        return float(all_together) * (size.share(part.blocks(size)) if part.blocks else 1)


def network_seconds(size: Size, bandwidth: float) -> float:
    """Return what a network adds to the measured ways within a machine; bandwidth in bytes a second.

    Workers that have the radiance of a sweep give it to others, so that it is everywhere after log2 of their
    number of ways; light comes back to the client from one worker after the other, as patches go to them.
    """
    ways = SENT * np.ceil(np.log2(max(size.workers, 2))) + RETURNED
    return float((size.sweeps * size.solved * ways + ROW * size.patches) / bandwidth)


def traffic(size: Size) -> dict[str, float]:
    """Return the bytes sent in each iteration, and the bytes of patches and visibility on each worker."""
    return {
        "to each worker in a sweep": SENT * size.solved,
        "to the client in a sweep": RETURNED * size.solved,
        "memory of each worker": (HOST + HOST_SHARED / size.workers) * size.patches,
        "samples on each device": SAMPLE * size.solved * size.samples * size.share(_blocks(size)),
    }


def main() -> None:
    """Print the model's constants, its times of measured bakes, and the time of a requested bake."""
    options = _parser().parse_args()
    records = [
        record for record in json.loads(options.results.read_text()) if record["devices"] == options.devices
    ]
    by_workers = [record for record in records if record["workers"]]
    left_out = set(options.left_out)
    model = CostModel([record for number, record in enumerate(by_workers) if number not in left_out])
    for part in PARTS:
        told = zip(part.terms, model.constants[part.name], strict=True)
        print(f"{part.name}: " + ", ".join(f"{constant:.3g} s a {term}" for term, constant in told))
    print("\n| patches | solved | rays | workers | measured s | model s | |\n|---|---|---|---|---|---|---|")
    for number, record in enumerate(by_workers):
        size = Size.of(record)
        told = sum(model.seconds(size).values())
        measured = sum(record["stages"].values()) - record["stages"]["devices"]
        sizes = f"{size.patches:,} | {size.solved:,.0f} | {size.samples:,} | {size.workers}"
        kept = "left out" if number in left_out else "fitted"
        print(f"| {sizes} | {measured:.2f} | {told:.2f} | {kept} |")
    if options.patches:
        _foretell(model, options)


def _foretell(model: CostModel, options: argparse.Namespace) -> None:
    """Print the predicted time of a bake."""
    solved, points = options.patches / options.groups**2, min(options.patches, _MOST_POINTS)
    size = Size(
        options.patches, solved, points, options.triangles, options.samples, options.sweeps, options.workers
    )
    print(f"\n{size.patches:,.0f} patches, {solved:,.0f} solved, {options.workers} workers:\n")
    print("| | s |\n|---|---|")
    seconds = model.seconds(size) | {"network": network_seconds(size, options.bandwidth)}
    for name, value in seconds.items():
        print(f"| {name} | {value:,.1f} |")
    print(f"| all | {sum(seconds.values()):,.1f} |")
    print("\n| | GB |\n|---|---|")
    for name, value in traffic(size).items():
        print(f"| {name} | {value / 1e9:,.2f} |")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path, help="what benchmarks/cluster.py has stored")
    parser.add_argument("--devices", default="processor", help="of which records")
    parser.add_argument(
        "--left-out", type=int, nargs="*", default=[], help="numbers of bakes that are not fitted"
    )
    parser.add_argument("--patches", type=float, default=0, help="of a bake whose time is estimated")
    parser.add_argument("--triangles", type=float, default=1e7)
    parser.add_argument("--samples", type=float, default=2048)
    parser.add_argument("--sweeps", type=float, default=6)
    parser.add_argument("--workers", type=int, default=1000)
    parser.add_argument("--bandwidth", type=float, default=1.25e9, help="of a network, bytes a second")
    parser.add_argument("--groups", type=int, default=4, help="width of the squares that are solved")
    return parser


if __name__ == "__main__":
    main()
