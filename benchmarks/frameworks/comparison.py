"""Times the two sums of a bake in GLSL, OpenCL and CUDA, and compares the results with NumPy.

python -m benchmarks.frameworks.comparison [--hemicubes 80] [--patches 10700] [--out FILE]

Hemicubes are 64 wide; patches have kept 3,072 samples each. Every kernel runs in groups of several sizes, the
best of which counts. Times are the least wall times of many; a framework that is not here is named.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import facts
from engine.visibility.views.hemicube import multiplier_map

from .cuda import CUDA
from .framework import Framework, MissingError
from .glsl import GLSL
from .kernel_texts import GATHER, INTEGRATE, NOTHING, KernelText
from .opencl import OpenCL

#: Widths of the hemicubes that are summed, and of those whose patch numbers are kept.
_DRAWN, _KEPT = 64, 32

#: Items of a group that are tried, starts in a row, and how often anything is timed.
_ITEMS, _STARTS, _REPEATS = (1, 32, 64, 128, 256), 200, 15

#: The largest difference to NumPy, relative.
_TOLERANCE = 1e-5


@dataclass(frozen=True)
class Case:
    """Kernel, its inputs, and its expected result.

    groups:  hemicubes or patches
    count:   numbers that each adds up
    truth:   (groups, 4) float64
    """

    kernel: KernelText
    inputs: tuple[np.ndarray, ...]
    groups: int
    count: int
    truth: np.ndarray


def integration(hemicubes: int) -> Case:
    """Return the sum of random hemicubes."""
    multiplier, random = multiplier_map(_DRAWN).ravel(), np.random.default_rng(1)
    texels = random.random((hemicubes, len(multiplier), 4), np.float32)
    truth = np.stack([multiplier.astype(float) @ texel.astype(float) for texel in texels])
    return Case(INTEGRATE, (texels, multiplier), hemicubes, len(multiplier), truth)


def gathering(patches: int) -> Case:
    """Return an iteration of random patches that see each other."""
    multiplier, random = multiplier_map(_KEPT).ravel(), np.random.default_rng(2)
    radiance = random.random((patches, 4), np.float32)
    seen = random.integers(0, patches, (patches, len(multiplier)), np.uint32)
    truth = np.stack([multiplier.astype(float) @ radiance[row].astype(float) for row in seen])
    return Case(GATHER, (seen, radiance, multiplier), patches, len(multiplier), truth)


def measured(framework: Framework, cases: tuple[Case, ...]) -> dict[str, Any]:
    """Return the times of a framework, s; raises RuntimeError if a result differs from NumPy's."""
    result = framework.upload(np.zeros((1, 4), np.float32))
    nothing = framework.build(NOTHING, 1)

    def start() -> None:
        framework.start(nothing, 1, (), result, 0)

    def start_many() -> None:
        for _ in range(_STARTS):
            start()

    def start_and_wait() -> None:
        start()
        framework.finish()

    start_and_wait()
    found: dict[str, Any] = {
        "device": framework.device,
        "wait": least(framework.finish),
        "start": least(start_many, framework.finish) / _STARTS,
        "start_and_wait": least(start_and_wait),
    }
    for case in cases:
        found[case.kernel.name] = summed(framework, case)
    return found


def summed(framework: Framework, case: Case) -> dict[str, Any]:
    """Return the times of a case, s: copies of its first input and of the result, and its kernel."""
    inputs = tuple(framework.upload(values) for values in case.inputs)
    result = framework.upload(np.zeros((case.groups, 4), np.float32))
    by_items, worst = {}, 0.0
    for items in _ITEMS:
        kernel = framework.build(case.kernel, items)

        def work(kernel: Any = kernel) -> None:
            framework.start(kernel, case.groups, inputs, result, case.count)
            framework.finish()

        by_items[items] = least(work)
        error = np.abs(framework.download(result, (case.groups, 4)) / case.truth - 1).max()
        worst = max(worst, float(error))
    if not worst < _TOLERANCE:
        raise RuntimeError(f"{framework.name} differs from NumPy in '{case.kernel.name}' by {worst:.1e}.")
    return {
        "copy_in": least(lambda: framework.refill(inputs[0], case.inputs[0])),
        "bytes_in": case.inputs[0].nbytes,
        "copy_out": least(lambda: framework.download(result, (case.groups, 4))),
        "bytes_out": 16 * case.groups,
        "items": min(by_items, key=by_items.__getitem__),
        "kernel": min(by_items.values()),
        "by_items": by_items,
        "error": worst,
    }


def least(work: Callable[[], Any], after: Callable[[], Any] = lambda: None) -> float:
    """Return the least wall time, s, of some work; `after` is done, but not timed."""
    work()
    after()
    times = []
    for _ in range(_REPEATS):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
        after()
    return min(times)


def main() -> None:
    """Print and store the times of each framework."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hemicubes", type=int, default=80)
    parser.add_argument("--patches", type=int, default=10_700)
    parser.add_argument("--out", type=Path, metavar="FILE", help="store all figures as JSON")
    options = parser.parse_args()
    cases = (integration(options.hemicubes), gathering(options.patches))
    found: dict[str, Any] = {}
    for kind in (GLSL, OpenCL, CUDA):
        try:
            found[kind.name] = measured(kind(), cases)
        except MissingError as missing:
            found[kind.name] = {"missing": str(missing)}
        print(f"{kind.name}: {json.dumps(found[kind.name], indent=1)}", flush=True)
    if options.out:
        sizes = {"hemicubes": options.hemicubes, "patches": options.patches}
        stored = {"machine": facts(), **sizes, "frameworks": found}
        options.out.write_text(json.dumps(stored, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
