"""`BilinearFit` on the OpenCL device: all channels at once, in float32 of light that is scaled."""

from __future__ import annotations

import numpy as np
import pyopencl as cl

from ..device.buffers import download, zeros
from ..device.compute import Compute
from .device_equations import DeviceEquations

_SOURCE = ("footprint.cl", "links.cl", "display_fit.cl")
_NAMES = (
    "sum_points", "spread_along_links", "spread_along_seams", "widen_ranges", "ranges_of_seams", "bound",
    "range_of_all", "differences", "begin_run", "curve", "advance", "turn", "add_up", "hold", "keep_texels",
)  # fmt: skip

#: Steps of the first run at most, and of the one with bounds; after so many it is looked whether it is done.
_STEPS, _FEWER, _LOOK = 20, 6, 4

#: Work items of a group, and of the one that adds up what groups have.
_GROUP, _ADDING = 64, 256

#: What `add_up` makes of sums, as in kernels/display_fit.cl.
_ENERGY, _STEP, _RATIO, _ENOUGH = map(np.int32, range(4))


class DeviceFit:
    """Texels from the light at points; see `BilinearFit`."""

    def __init__(self, compute: Compute, equations: DeviceEquations) -> None:
        self._compute, self._equations = compute, equations
        self._kernels = dict(zip(_NAMES, compute.kernels(_SOURCE, *_NAMES), strict=True))
        count = self._count = np.int32(equations.count)
        self._rows = (
            equations.neighbours, equations.factors, equations.linked, equations.starts, equations.read_by,
            equations.shares,
        )  # fmt: skip
        names = ("right", "solution", "residual", "direction", "change", "low", "high")
        self._vectors = {name: zeros(compute, 16 * int(count)) for name in names}
        self._products, self._more_products = (zeros(compute, 16 * max(1, equations.seams)) for _ in range(2))
        self._held = zeros(compute, 4 * (int(count) // 4 + 1))
        self._run_numbers, self._all_points = zeros(compute, 64), zeros(compute, 32)
        self._group = self._kernels["curve"].group(_GROUP)[0]
        self._adding = self._kernels["add_up"].group(_ADDING)[0]
        self._groups = -(-int(count) // self._group)
        self._sums = zeros(compute, 16 * self._groups)

    def fit(self, image: cl.Buffer, light: cl.Buffer, largest: float) -> None:
        """Give the unknown texels of an image their values.

        image    float4 of each texel; those whose centre counts have its light
        light    float4 of each point beside centres
        largest  of all their absolute values
        """
        scale = np.float32(largest if largest > 0 else 1)
        self._start(image, light, np.float32(1 / scale))
        self._bound()
        cl.enqueue_fill_buffer(self._compute.queue, self._held, np.zeros(1, np.uint8), 0, self._held.size)
        for first, steps in ((True, _STEPS), (False, _FEWER)):
            self._descend(first, steps)
            vectors = self._vectors
            self._run("hold", vectors["low"], vectors["high"], vectors["solution"], self._held)
        self._run("keep_texels", self._equations.texels, self._vectors["solution"], scale, image)

    def _run(self, name: str, *arguments: object) -> None:
        """Run a kernel for each unknown."""
        self._compute.run(self._kernels[name], int(self._count), *arguments, self._count)

    def _run_seams(self, name: str, *arguments: object) -> None:
        """Run a kernel for each seam."""
        count = self._equations.seams
        if count:
            self._compute.run(self._kernels[name], count, *arguments, np.int32(count))

    def _summed(self, name: str, made: np.int32, *arguments: object) -> None:
        """Run a kernel that sums over unknowns; make a number of the run of it."""
        local = cl.LocalMemory(16 * self._group)
        size = (self._groups * self._group,)
        queue = self._compute.queue
        self._kernels[name](queue, size, (self._group,), *arguments, self._sums, self._count, local)
        self._kernels["add_up"](
            queue, (self._adding,), (self._adding,), self._sums, np.int32(self._groups), made,
            self._run_numbers, cl.LocalMemory(16 * self._adding),
        )  # fmt: skip

    def _start(self, image: cl.Buffer, light: cl.Buffer, scale: np.float32) -> None:
        """Start at the mean of points, carried to texels that none reads; find the ranges of points."""
        equations, vectors = self._equations, self._vectors
        reached, resolution = self._held, np.int32(equations.resolution)
        self._run(
            "sum_points", equations.texels, equations.centre, image, equations.neighbours, equations.ranges,
            equations.positions, equations.weights, light, scale, vectors["right"], vectors["solution"],
            reached, vectors["residual"], vectors["direction"], resolution,
        )  # fmt: skip
        for number in (2, 3):
            self._run(
                "spread_along_links", equations.neighbours, equations.linked, np.uint8(number), reached,
                vectors["solution"],
            )  # fmt: skip
        self._run(
            "spread_along_seams", equations.starts, equations.read_by, equations.columns, np.uint8(4),
            reached, vectors["solution"],
        )  # fmt: skip

    def _bound(self) -> None:
        """Find the bounds of the unknowns; the ranges of their own points are in two vectors of a run."""
        equations, vectors = self._equations, self._vectors
        own, bounds = (vectors["residual"], vectors["direction"]), (vectors["low"], vectors["high"])
        seams = self._products, self._more_products
        self._run("widen_ranges", equations.neighbours, equations.linked, *own, *bounds)
        self._run_seams("ranges_of_seams", equations.columns, *bounds, *seams)
        self._kernels["range_of_all"](
            self._compute.queue, (self._adding,), (self._adding,), *own, self._all_points, self._count,
            cl.LocalMemory(32 * self._adding),
        )  # fmt: skip
        self._run("bound", equations.starts, equations.read_by, *seams, self._all_points, *bounds)

    def _descend(self, first: bool, steps: int) -> None:
        """Run conjugate gradients of what is not held, preconditioned by the diagonal (Shewchuk 1994)."""
        vectors, inverse, run = self._vectors, self._equations.inverse, self._run_numbers
        solution, residual, direction = (vectors[name] for name in ("solution", "residual", "direction"))
        if first:
            cl.enqueue_fill_buffer(self._compute.queue, self._held, np.zeros(1, np.uint8), 0, self._held.size)
        self._difference(solution)
        self._summed(
            "begin_run", _ENOUGH if first else _ENERGY, *self._rows, inverse, vectors["right"], self._held,
            solution, self._products, residual, direction,
        )  # fmt: skip
        for step in range(steps):
            if step % _LOOK == 0 and self._done():
                return
            self._difference(direction)
            self._summed(
                "curve", _STEP, *self._rows, self._held, direction, self._products, vectors["change"]
            )
            self._summed("advance", _RATIO, inverse, direction, vectors["change"], run, solution, residual)
            self._run("turn", inverse, residual, run, direction)

    def _difference(self, values: cl.Buffer) -> None:
        """Find what the sides of seams differ by in some values of the unknowns."""
        equations = self._equations
        self._run_seams("differences", equations.columns, equations.entries, values, self._products)

    def _done(self) -> bool:
        """Return whether every channel has little energy left."""
        numbers = download(self._compute, self._run_numbers, (4, 4))
        return bool((numbers[_ENERGY] <= numbers[_ENOUGH]).all())
