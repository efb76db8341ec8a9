"""OpenCL version of `BilinearFit`: all channels of several images at once, in float32.

Light is divided by its largest value, so that sums of squares stay in the range of float32.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..device.buffers import download, upload, words_of, zeros
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from .device_bilinear_equations import SOURCE, DeviceBilinearEquations

_NAMES = (
    "sum_points", "spread_along_links", "spread_along_seams", "widen_ranges", "ranges_of_seams", "bound",
    "range_of_all", "differences", "begin_run", "begin_steps", "cg_curvature", "advance", "cg_direction",
    "descend", "clamp_bounds", "keep_texels",
)  # fmt: skip

#: Kernels with the same groups.
_SUMMING = ("range_of_all", "begin_run", "begin_steps", "cg_curvature", "advance", "cg_direction", "descend")

#: Maximum iterations of the unconstrained and the bounded run, and iterations between tests for convergence.
_STEPS, _FEWER, _LOOK = 20, 6, 4

#: Work items of a group in the kernels that sum, and maximum number of groups: each group of the next kernel
#: adds up the partial sums of all.
_GROUP, _GROUPS = 256, 256

#: Unknowns up to which one work group runs all iterations, so that launches do not take more time than the
#: work (chosen).
_SMALL = 256

#: Index of the stopping threshold among the scalars of a run, as in kernels/postprocess/bilinear_fit.cl. The
#: residual norms of even and odd steps come before it.
_ENOUGH = 2


class DeviceBilinearFit:
    """Least-squares fit of texels to light at points; see `BilinearFit`.

    tight:  True if no texel may exceed its nearest samples, or the surrounding samples where it has none
    """

    def __init__(
        self, compute: ComputeDevice, equations: DeviceBilinearEquations, tight: bool = False
    ) -> None:
        self._compute, self._equations, self._tight = compute, equations, np.int32(tight)
        self._kernels = dict(zip(_NAMES, compute.kernels(SOURCE, *_NAMES), strict=True))
        count = self._count = np.int32(equations.count)
        self._rows = (
            equations.neighbours, equations.factors, equations.linked, equations.starts, equations.read_by,
            equations.shares,
        )  # fmt: skip
        self._rows_of_seams = np.int32(equations.seams)
        self._group = min(self._kernels[name].group(_GROUP)[0] for name in _SUMMING)
        self._groups = min(_GROUPS, -(-int(count) // self._group))
        self._is_small = int(count) <= _SMALL
        self._size = np.uint32(equations.size)
        self._reserve(1)

    def _reserve(self, images: int) -> None:
        """Allocate buffers for the given number of images."""
        compute, count, seams = self._compute, int(self._count), max(1, self._equations.seams)
        names = ("right", "solution", "residual", "direction", "following", "change", "low", "high")
        self._images, self._vectors = images, {name: self._buffer(16 * count * images) for name in names}
        self._products, self._more_products = (self._buffer(16 * seams * images) for _ in range(2))
        self._held, self._run_numbers = zeros(compute, words_of(count * images)), zeros(compute, 48 * images)
        self._all_points = self._buffer(32 * images)
        self._curvatures, self._energies = (self._buffer(16 * self._groups * images) for _ in range(2))

    def _buffer(self, size: int) -> cl.Buffer:
        """Return a buffer of `size` bytes with undefined contents."""
        return cl.Buffer(self._compute.context, cl.mem_flags.READ_WRITE, size)

    def fit(self, images: cl.Buffer, light: cl.Buffer, largest: Sequence[float]) -> None:
        """Write the fitted values of the unknown texels into images.

        images:   float4 for each texel; texels with a centre sample hold its light
        light:    float4 for each off-centre sample, one image after the other
        largest:  largest absolute value of each image
        """
        scales, solution = self._solve(images, light, largest), self._vectors["solution"]
        self._run("keep_texels", self._equations.texels, solution, scales, images, self._size)

    def unknowns(self, light: cl.Buffer, largest: float) -> np.ndarray:
        """Return the fitted values of the unknowns of one image without centre samples, (n, 3) float32.

        light:    float4 for each sample
        largest:  largest absolute value
        """
        scales, solution = self._solve(light, light, [largest]), self._vectors["solution"]
        scale = download(self._compute, scales, (2,))[0]
        return scale * download(self._compute, solution, (int(self._count), 4))[:, :3]

    def _solve(self, images: cl.Buffer, light: cl.Buffer, largest: Sequence[float]) -> cl.Buffer:
        """Solve for the scaled light; return the scale and its inverse for each image, float2."""
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

    def _summed(self, name: str, *arguments: object, groups: int | None = None) -> None:
        """Run a kernel whose groups sum over the unknowns; None for the groups of all partial sums."""
        size = (self._group * (groups or self._groups), self._images)
        local = cl.LocalMemory(16 * self._group)
        self._kernels[name](self._compute.queue, size, (self._group, 1), *arguments, local)

    def _start(self, images: cl.Buffer, light: cl.Buffer, scales: cl.Buffer) -> None:
        """Compute the initial values of the unknowns, and the range of the samples around each.

        The start is the mean of the samples in a texel, propagated to texels without samples.
        """
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
        """Compute the bounds of the unknowns; buffers `residual` and `direction` hold the sample ranges."""
        equations, vectors = self._equations, self._vectors
        own, bounds = (vectors["residual"], vectors["direction"]), (vectors["low"], vectors["high"])
        seams = self._products, self._more_products
        self._run("widen_ranges", equations.neighbours, equations.linked, *own, *bounds)
        self._run_seams("ranges_of_seams", equations.columns, *bounds, *seams)
        self._kernels["range_of_all"](
            self._compute.queue, (self._group, self._images), (self._group, 1), *own, self._all_points,
            self._count, cl.LocalMemory(32 * self._group),
        )  # fmt: skip
        listed = equations.starts, equations.read_by
        nearest = own[1], self._tight
        self._run("bound", *listed, *seams, self._all_points, *nearest, *bounds, self._rows_of_seams)

    def _descend(self, first: bool, steps: int) -> None:
        """Run Jacobi-preconditioned conjugate gradients (Shewchuk 1994) on unknowns not at a bound.

        A GPU runs all steps, since steps of converged channels change nothing and a test would wait for it.
        """
        if self._is_small:
            self._descend_at_once(first, steps)
            return
        vectors, equations, sizes = self._vectors, self._equations, (self._rows_of_seams, self._count)
        inverse, run, seam_rows = equations.inverse, self._run_numbers, (equations.columns, equations.entries)
        solution, residual, change = (vectors[name] for name in ("solution", "residual", "change"))
        self._difference(solution)
        self._summed(
            "begin_run", *self._rows, inverse, vectors["right"], self._held, solution, self._products,
            residual, vectors["direction"], self._energies, *sizes,
        )  # fmt: skip
        begun = self._energies, np.int32(self._groups), np.int32(first), run
        self._summed("begin_steps", *begun, groups=1)
        self._difference(vectors["direction"])
        for step in range(steps):
            if self._compute.processor and step % _LOOK == 0 and self._done(step % 2):
                return
            odd, direction, following = np.int32(step % 2), vectors["direction"], vectors["following"]
            self._summed(
                "cg_curvature", *self._rows, self._held, direction, self._products, change,
                self._curvatures, *sizes,
            )  # fmt: skip
            self._summed(
                "advance", inverse, direction, change, self._curvatures, run, odd, solution, residual,
                self._energies, self._count,
            )  # fmt: skip
            if step < steps - 1:
                self._summed(
                    "cg_direction", *seam_rows, inverse, residual, self._energies, run, odd, direction,
                    following, self._products, *sizes,
                )  # fmt: skip
                vectors["direction"], vectors["following"] = following, direction

    def _descend_at_once(self, first: bool, steps: int) -> None:
        """Run all iterations with one work group per image."""
        equations, vectors, width = self._equations, self._vectors, max(1, _SMALL // self._group)
        names = ("residual", "direction", "change")
        self._kernels["descend"](
            self._compute.queue, (self._group, self._images), (self._group, 1), *self._rows,
            equations.columns, equations.entries, equations.inverse, vectors["right"], self._held,
            vectors["solution"], self._products, *(vectors[name] for name in names), self._run_numbers,
            np.int32(first), np.int32(steps), self._rows_of_seams, self._count,
            cl.LocalMemory(16 * self._group), cl.LocalMemory(16 * width), np.int32(width),
        )  # fmt: skip

    def _difference(self, values: cl.Buffer) -> None:
        """Look up a vector of unknowns on both sides of each seam row; store the difference."""
        equations = self._equations
        self._run_seams("differences", equations.columns, equations.entries, values, self._products)

    def _done(self, odd: int) -> bool:
        """Return True if the residual of every channel of every image is below its tolerance.

        odd:  1 before an odd step
        """
        numbers = download(self._compute, self._run_numbers, (self._images, _ENOUGH + 1, 4))
        return bool((numbers[:, odd] <= numbers[:, _ENOUGH]).all())
