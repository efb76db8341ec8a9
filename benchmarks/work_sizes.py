"""Times work group shapes of the main kernels (paper, V.C), and stores the best on request.

python -m benchmarks.work_sizes [--keep FOLDER] [--out FILE] [--resolution 128]

A shape is taken in place of the usual one if it is faster by 3 % at least. Bakes whose `cache_dir` is FOLDER
use what is kept there. Times are the device's; on a processor, which others may use, too, what it has spent.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pyopencl as cl

from benchmarks.configurations import settings
from benchmarks.machine import facts
from benchmarks.profiled import ProfiledCompute
from benchmarks.rooms import cornell_box
from benchmarks.solving import solve_job
from benchmarks.tables import table
from engine.device.buffers import upload
from engine.device.cl_device import ComputeDevice
from engine.device.work_sizes import WorkSizes
from engine.gather.opencl_integrator import HemicubeIntegrator
from engine.gather.visibility_cache import BackfaceLight
from engine.plan.choose_solver import choose_solver
from engine.plan.solve_job import SolveJob
from engine.visibility.raster.tiles import Tiles
from engine.visibility.rays.ray_sampler import RaySampler

#: A shape has to be faster than the usual one by this part, and each is timed so often.
_LEAST_GAIN, _ROUNDS = 0.03, 7

_ITEMS = tuple((1 << power,) for power in range(9))

#: Shapes that are tried.
SHAPES: dict[str, tuple[tuple[int, ...], ...]] = {
    "look": _ITEMS,
    "gather": _ITEMS,
    "multiply": (
        (1, 1, 1), (8, 1, 1), (32, 1, 1), (64, 1, 1), (128, 1, 1), (256, 1, 1), (8, 8, 1),
        (16, 16, 1), (32, 4, 1), (32, 8, 1), (32, 16, 1),
    ),
    "reduce_row": ((1, 1), (8, 1), (16, 1), (32, 1), (64, 1), (128, 1), (256, 1), (8, 8), (32, 4)),
    "reduce_column": ((1,), (8,), (16,), (32,), (64,), (128,), (256,)),
}  # fmt: skip

#: Rays a patch, width of hemicubes, and the paper's texture array, texels and layers.
_RAYS, _HEMICUBE, _ARRAY = 256, 64, 1024

#: Returns the seconds that a kernel takes with some shapes.
Timer = Callable[[str, WorkSizes], float]


def tuned(
    usual: WorkSizes, shapes: Mapping[str, Sequence[tuple[int, ...]]], seconds: Timer
) -> tuple[WorkSizes, dict[str, dict[tuple[int, ...], float]]]:
    """Return the best shape of each kernel, and the median time of each shape, s, by kernel.

    Shapes are timed in turn, so that what slows the device for a while slows all of them.
    """
    best, medians = usual, {}
    for name, tried in shapes.items():
        at_first = getattr(usual, name)
        times: dict[tuple[int, ...], list[float]] = {shape: [] for shape in dict.fromkeys([at_first, *tried])}
        for _ in range(_ROUNDS):
            for shape, found in times.items():
                found.append(seconds(name, replace(usual, **{name: shape})))
        medians[name] = {shape: statistics.median(found) for shape, found in times.items()}
        fastest = min(medians[name], key=medians[name].__getitem__)
        if medians[name][fastest] < (1 - _LEAST_GAIN) * medians[name][at_first]:
            best = replace(best, **{name: fastest})
    return best, medians


@contextmanager
def kernel_timer(compute: ProfiledCompute, resolution: int) -> Iterator[Timer]:
    """Yield a function that times the kernels on a Cornell box and on random hemicubes."""
    chosen = settings({"method": "cached", "visibility": "rays", "samples": _RAYS}, resolution=resolution)
    with ExitStack() as stack:
        job = stack.enter_context(solve_job(cornell_box(resolution), chosen, compute))
        works = {"look": _looks(job), "gather": _gathers(job)}
        works |= dict.fromkeys(("multiply", "reduce_row", "reduce_column"), _integrates(compute))
        built: set[tuple[str, WorkSizes]] = set()

        def seconds(name: str, sizes: WorkSizes) -> float:
            compute.work_sizes = sizes
            if (name, sizes) not in built:
                works[name]()
                built.add((name, sizes))
            return _seconds(compute, name, works[name])

        yield seconds


def _seconds(compute: ProfiledCompute, name: str, work: Callable[[], None]) -> float:
    """Return the time of a kernel during some work, s."""
    compute.queue.finish()
    compute.events.clear()
    compute.processor_seconds.clear()
    work()
    return compute.processor_seconds[name] if compute.processor else compute.seconds(name)


def _looks(job: SolveJob) -> Callable[[], None]:
    """Return a function that traces the visibility samples of all patches."""
    compute = job.opencl
    identity = RaySampler(compute, job.rays, job.patch_scene, job.background, job.settings)
    cache = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, identity.row_bytes * job.count)
    backs = BackfaceLight(compute, job.count, len(job.emission), directional=False)

    def work() -> None:
        for _ in identity.find(0, job.count, backs.found_with(cache, 0)):
            pass

    return work


def _gathers(job: SolveJob) -> Callable[[], None]:
    """Return a function that gathers once from cached visibility."""
    solver = choose_solver(job)[0]

    def work() -> None:
        for _ in solver.iteration():
            pass

    work()
    return work


def _integrates(compute: ComputeDevice) -> Callable[[], None]:
    """Return a function that integrates an array of random hemicubes."""
    rows = _ARRAY // (3 * _HEMICUBE)
    tiles = Tiles(_HEMICUBE, _ARRAY // _HEMICUBE, rows, 1 if compute.processor else 8)
    random = np.random.default_rng(5)
    texels = random.random((tiles.layers, tiles.height, tiles.width, 4), np.float32)
    hemicubes, sky = upload(compute, texels), np.zeros((1, 1, 3), np.float32)
    frames = np.tile(np.float32([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1]]), (tiles.capacity, 1, 1))

    def work() -> None:
        HemicubeIntegrator(compute, tiles, sky).integrate(hemicubes, frames)

    return work


def written(shape: Sequence[int]) -> str:
    """Return a shape as the paper writes it."""
    return " × ".join(map(str, shape))


def main() -> None:
    """Print a table for each kernel."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--keep", metavar="FOLDER", help="keep the best shapes for bakes with this cache_dir")
    parser.add_argument("--out", type=Path, metavar="FILE", help="store all times as JSON")
    parser.add_argument("--resolution", type=int, default=128)
    options = parser.parse_args()
    compute, began = ProfiledCompute(), time.perf_counter()
    with kernel_timer(compute, options.resolution) as timer:
        best, medians = tuned(compute.default_sizes, SHAPES, timer)
    usual = asdict(compute.default_sizes)
    print(f"{compute.name}, {time.perf_counter() - began:.0f} s")
    for name, times in medians.items():
        print(f"\n{name}: {written(usual[name])} as a rule, {written(asdict(best)[name])} here\n")
        rows = [(written(shape), 1e3 * took, times[usual[name]] / took) for shape, took in times.items()]
        print(table(("shape", "ms", "times as fast"), rows))
    if options.out:
        named = {
            name: {written(shape): 1e3 * took for shape, took in times.items()}
            for name, times in medians.items()
        }
        stored = {"machine": facts(), "ms": named, "usual": usual, "best": asdict(best)}
        options.out.write_text(json.dumps(stored, indent=1) + "\n", encoding="utf-8")
    if options.keep:
        compute.kept_sizes(options.keep).keep(best, compute.default_sizes)


if __name__ == "__main__":
    main()
