"""`BilinearFit` on the OpenCL device: all channels of several images at once, in float32 of scaled light."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..device.buffers import download, upload, words_of, zeros
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from .device_bilinear_equations import DeviceBilinearEquations

_NAMES = (
    "sum_points", "spread_along_links", "spread_along_seams", "widen_ranges", "ranges_of_seams", "bound",
    "range_of_all", "differences", "begin_run", "cg_curvature", "advance", "cg_direction", "add_up",
    "clamp_bounds", "keep_texels",
)  # fmt: skip

#: Steps of the first run at most, and of the one with bounds; after so many it is looked whether it is done.
_STEPS, _FEWER, _LOOK = 20, 6, 4

#: Work items of a group, and of the one that adds up what groups have.
_GROUP, _ADDING = 64, 256

#: What `add_up` makes of sums, as in kernels/postprocess/bilinear_fit.cl.
_ENERGY, _STEP, _RATIO, _ENOUGH = map(np.int32, range(4))


class DeviceBilinearFit:
    """Texels from the light at points; see `BilinearFit`.

    tight: whether a texel is no brighter than the points nearest to it, where it has some, and not than those
    around it
    """

    def __init__(
        self, compute: ComputeDevice, equations: DeviceBilinearEquations, tight: bool = False
    ) -> None:
        self._compute, self._equations, self._tight = compute, equations, np.int32(tight)
        self._kernels = dict(zip(_NAMES, compute.kernels("bilinear_fit.cl", *_NAMES), strict=True))
        count = self._count = np.int32(equations.count)
        self._rows = (
            equations.neighbours, equations.factors, equations.linked, equations.starts, equations.read_by,
            equations.shares,
        )  # fmt: skip
        self._rows_of_seams = np.int32(equations.seams)
        self._group = self._kernels["cg_curvature"].group(_GROUP)[0]
        self._adding = self._kernels["add_up"].group(_ADDING)[0]
        self._groups = -(-int(count) // self._group)
        self._size = np.uint32(equations.size)
        self._reserve(1)

    def _reserve(self, images: int) -> None:
        """Have memory for so many images; kernels write most of it before they read it."""
        compute, count, seams = self._compute, int(self._count), max(1, self._equations.seams)
        names = ("right", "solution", "residual", "direction", "change", "low", "high")
        self._images, self._vectors = images, {name: self._buffer(16 * count * images) for name in names}
        self._products, self._more_products = (self._buffer(16 * seams * images) for _ in range(2))
        self._held, self._run_numbers = zeros(compute, words_of(count * images)), zeros(compute, 64 * images)
        self._all_points = self._buffer(32 * images)
        self._sums = self._buffer(16 * self._groups * images)

    def _buffer(self, size: int) -> cl.Buffer:
        """Return a buffer of `size` bytes whose contents are undefined."""
        return cl.Buffer(self._compute.context, cl.mem_flags.READ_WRITE, size)

    def fit(self, images: cl.Buffer, light: cl.Buffer, largest: Sequence[float]) -> None:
        """Give the unknown texels of images their values.

        images   float4 of each texel; those whose centre counts have its light
        light    float4 of each point beside centres, one image after the other
        largest  of each image, of all absolute values
        """
        scales, solution = self._solve(images, light, largest), self._vectors["solution"]
        self._run("keep_texels", self._equations.texels, solution, scales, images, self._size)

    def unknowns(self, light: cl.Buffer, largest: float) -> np.ndarray:
        """Return the values of the unknown texels of one image, (n, 3) float32, where no centre counts.

        light: float4 of each point; largest: of all absolute values
        """
        scales, solution = self._solve(light, light, [largest]), self._vectors["solution"]
        scale = download(self._compute, scales, (2,))[0]
        return scale * download(self._compute, solution, (int(self._count), 4))[:, :3]

    def _solve(self, images: cl.Buffer, light: cl.Buffer, largest: Sequence[float]) -> cl.Buffer:
        """Find the solution of scaled light; return the scales of each image and their inverses, float2."""
        if len(largest) != self._images:
            self._reserve(len(largest))
        scale = np.array([value if value > 0 else 1 for value in largest], np.float32)
        scales = upload(self._compute, np.stack([scale, 1 / scale], axis=1))
        self._start(images, light, scales)
        self._bound()
        cl.enqueue_fill_buffer(self._compute.queue, self._held, np.zeros(1, np.uint8), 0, self._held.size)
        for first, steps in ((True, _STEPS), (False, _FEWER)):
            self._descend(first, steps)
            vectors = self._vectors
            self._run("clamp_bounds", vectors["low"], vectors["high"], vectors["solution"], self._held)
        return scales

    def _run(self, name: str, *arguments: object) -> None:
        """Run a kernel for each unknown of each image."""
        self._compute.run(self._kernels[name], int(self._count), *arguments, self._count, layers=self._images)

    def _run_seams(self, name: str, *arguments: object) -> None:
        """Run a kernel for each seam of each image."""
        count = self._equations.seams
        if count:
            arguments = *arguments, self._count, np.int32(count)
            self._compute.run(self._kernels[name], count, *arguments, layers=self._images)

    def _summed(self, name: str, made: np.int32, *arguments: object) -> None:
        """Run a kernel that sums over unknowns; make a number of the run of it."""
        local = cl.LocalMemory(16 * self._group)
        size = (self._groups * self._group, self._images)
        queue = self._compute.queue
        self._kernels[name](queue, size, (self._group, 1), *arguments, self._count, local)
        self._kernels["add_up"](
            queue, (self._adding, self._images), (self._adding, 1), self._sums, np.int32(self._groups), made,
            self._run_numbers, cl.LocalMemory(16 * self._adding),
        )  # fmt: skip

    def _start(self, images: cl.Buffer, light: cl.Buffer, scales: cl.Buffer) -> None:
        """Start at the mean of points, carried to texels that none reads; find the ranges of points."""
        equations, vectors = self._equations, self._vectors
        reached, resolution = self._held, np.int32(equations.resolution)
        self._run(
            "sum_points", equations.texels, equations.centre, images, equations.neighbours, equations.ranges,
            equations.positions, equations.weights, light, scales, vectors["right"],
            vectors["solution"], reached, vectors["residual"], vectors["direction"], resolution, self._size,
            np.int32(equations.points),
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
            self._compute.queue, (self._adding, self._images), (self._adding, 1), *own, self._all_points,
            self._count, cl.LocalMemory(32 * self._adding),
        )  # fmt: skip
        listed = equations.starts, equations.read_by
        nearest = own[1], self._tight
        self._run("bound", *listed, *seams, self._all_points, *nearest, *bounds, self._rows_of_seams)

    def _descend(self, first: bool, steps: int) -> None:
        """Run conjugate gradients of what is not held, preconditioned by the diagonal (Shewchuk 1994)."""
        vectors, inverse, run = self._vectors, self._equations.inverse, self._run_numbers
        solution, residual, direction = (vectors[name] for name in ("solution", "residual", "direction"))
        if first:
            cl.enqueue_fill_buffer(self._compute.queue, self._held, np.zeros(1, np.uint8), 0, self._held.size)
        self._difference(solution)
        self._summed(
            "begin_run", _ENOUGH if first else _ENERGY, *self._rows, inverse, vectors["right"], self._held,
            solution, self._products, residual, direction, self._sums, self._rows_of_seams,
        )  # fmt: skip
        for step in range(steps):
            if step % _LOOK == 0 and self._done():
                return
            self._difference(direction)
            self._summed(
                "cg_curvature", _STEP, *self._rows, self._held, direction, self._products, vectors["change"],
                self._sums, self._rows_of_seams,
            )  # fmt: skip
            self._summed(
                "advance", _RATIO, inverse, direction, vectors["change"], run, solution, residual, self._sums
            )
            self._run("cg_direction", inverse, residual, run, direction)

    def _difference(self, values: cl.Buffer) -> None:
        """Find what the sides of seams differ by in some values of the unknowns."""
        equations = self._equations
        self._run_seams("differences", equations.columns, equations.entries, values, self._products)

    def _done(self) -> bool:
        """Return whether every channel of every image has little energy left."""
        numbers = download(self._compute, self._run_numbers, (self._images, 4, 4))
        return bool((numbers[:, _ENERGY] <= numbers[:, _ENOUGH]).all())
