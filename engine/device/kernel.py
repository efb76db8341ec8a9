"""An OpenCL kernel that starts quickly, in groups that its device can run."""

from __future__ import annotations

import math

import numpy as np

from .opencl import cl

#: Work items of a group whose items have nothing to do with each other.
ITEMS = 64


class Kernel:
    """A kernel of a program; it learns the types of its scalar arguments from its first call.

    Starting a kernel whose types are known takes a quarter of the host's time.

    most_items       the most work items that a group of this kernel may have
    preferred_items  work items that the device runs in lockstep: the least efficient size of a group
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
        """Return the work group of this kernel that is nearest to one of these sides, powers of two.

        Sides are halved, the last first, until the device can run it: how many items that is may depend on
        the kernel, as on the registers that it needs.
        """
        if sides not in self._groups:
            self._groups[sides] = self._nearest(sides)
        return self._groups[sides]

    def _nearest(self, sides: tuple[int, ...]) -> tuple[int, ...]:
        """Return what `group` returns."""
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
        """Start `items` work items, in groups of one size: PoCL fails to choose one where groups are small.

        arguments  buffers, local memory, NumPy scalars, and arrays for vectors
        """
        if not self._typed:
            self._kernel.set_arg_types([_type(argument) for argument in arguments])
            self._typed = True
        return self._kernel(queue, items, group, *arguments)


def run_on(queue: cl.CommandQueue, kernel: Kernel, items: int, *arguments: object, layers: int = 1) -> None:
    """Run a kernel for at least `items` work items of each layer; it has to ignore those beyond.

    Work groups have one size whatever the number of items, since PoCL compiles a kernel anew for each.
    """
    (size,) = kernel.group(ITEMS)
    kernel(queue, (-(-items // size) * size, layers), (size, 1), *arguments)


def _halved(side: int, most: int) -> int:
    """Return a power of two halved until it is at most `most`, but no more often than to 1."""
    while side > max(most, 1):
        side //= 2
    return side


def _type(argument: object) -> np.dtype | None:
    """Return what an argument's bits are: a number, a vector's bytes, or None for memory."""
    if isinstance(argument, np.generic):
        return argument.dtype
    return np.dtype((np.void, argument.nbytes)) if isinstance(argument, np.ndarray) else None
