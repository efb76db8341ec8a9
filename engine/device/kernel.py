"""OpenCL kernel with fast launches and work groups that fit the device."""

from __future__ import annotations

import math

import numpy as np

from .opencl import cl

#: Work-group size of kernels with independent items.
ITEMS = 64


class Kernel:
    """Kernel of a program that derives its scalar argument types from the first call.

    A launch with known types takes a quarter of the host time.

    most_items:       maximum work-group size of this kernel
    preferred_items:  items that the device runs in lockstep, the minimum efficient group size
    """

    def __init__(self, program: cl.Program, name: str, device: cl.Device) -> None:
        self._kernel, self._typed = cl.Kernel(program, name), False
        limit = cl.kernel_work_group_info.WORK_GROUP_SIZE
        self.most_items = int(self._kernel.get_work_group_info(limit, device))
        preferred = cl.kernel_work_group_info.PREFERRED_WORK_GROUP_SIZE_MULTIPLE
        self.preferred_items = int(self._kernel.get_work_group_info(preferred, device))
        self._sides = device.max_work_item_sizes
        self._groups: dict[tuple[int, ...], tuple[int, ...]] = {}

    def group(self, *sides: int) -> tuple[int, ...]:
        """Return the work-group size closest to the given sides, powers of two, that the device runs.

        Sides are halved, the last first, until the group fits. The limit depends on the kernel, for example
        on its registers.
        """
        if sides not in self._groups:
            self._groups[sides] = self._nearest(sides)
        return self._groups[sides]

    def _nearest(self, sides: tuple[int, ...]) -> tuple[int, ...]:
        """Halve the sides until the group fits the device; return its size along each axis."""
        fitting = [_halved(side, most) for side, most in zip(sides, self._sides, strict=False)]
        for axis in reversed(range(len(fitting))):
            others = math.prod(fitting) // fitting[axis]
            fitting[axis] = _halved(fitting[axis], self.most_items // others)
        return tuple(fitting)

    def __call__(
        self,
        queue: cl.CommandQueue,
        items: tuple[int, ...],
        group: tuple[int, ...],
        *arguments: object,
    ) -> cl.Event:
        """Launch `items` work items in groups of one size; PoCL fails to choose one for small groups.

        arguments:  buffers, local memory, NumPy scalars, and arrays for vectors
        """
        if not self._typed:
            self._kernel.set_arg_types([_type(argument) for argument in arguments])
            self._typed = True
        return self._kernel(queue, items, group, *arguments)


def run_on(queue: cl.CommandQueue, kernel: Kernel, items: int, *arguments: object, layers: int = 1) -> None:
    """Run a kernel for at least `items` work items in each layer; it must ignore the surplus.

    The work-group size does not depend on the number of items, since PoCL compiles a kernel for each size.
    """
    (size,) = kernel.group(ITEMS)
    kernel(queue, (-(-items // size) * size, layers), (size, 1), *arguments)


def _halved(side: int, most: int) -> int:
    """Halve a power of two until it is at most `most`, but not below 1."""
    while side > max(most, 1):
        side //= 2
    return side


def _type(argument: object) -> np.dtype | None:
    """Return the type of an argument: dtype of a number, bytes of a vector, or None for memory."""
    if isinstance(argument, np.generic):
        return argument.dtype
    return np.dtype((np.void, argument.nbytes)) if isinstance(argument, np.ndarray) else None


class SideQueue:
    """Kernel of one thread and its own queue, parallel to the queue of the bake.

    A kernel object stores the arguments of one launch, so threads must not share it.
    """

    def __init__(self, queue: cl.CommandQueue, kernel: Kernel) -> None:
        self._queue, self._kernel = queue, kernel

    def run(self, items: int, *arguments: object, layers: int = 1) -> None:
        """Run the kernel for at least `items` work items in each layer; it must ignore the surplus."""
        run_on(self._queue, self._kernel, items, *arguments, layers=layers)

    def upload(self, values: np.ndarray) -> cl.Buffer:
        """Return a buffer with the contents of a nonempty array."""
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self._queue.context, flags, hostbuf=np.ascontiguousarray(values))

    def room_for(self, size: int) -> cl.Buffer:
        """Return a buffer of `size` bytes, at least one."""
        return cl.Buffer(self._queue.context, cl.mem_flags.READ_WRITE, size)

    def download(self, values: np.ndarray, buffer: cl.Buffer) -> None:
        """Read a buffer into an array; waits for all earlier commands."""
        if values.nbytes:
            cl.enqueue_copy(self._queue, values, buffer)
