"""An OpenCL kernel that starts quickly."""

from __future__ import annotations

import numpy as np
import pyopencl as cl


class Kernel:
    """A kernel of a program; it learns the types of its scalar arguments from its first call.

    Starting a kernel whose types are known takes a quarter of the host's time.
    """

    def __init__(self, program: cl.Program, name: str) -> None:
        self._kernel, self._typed = cl.Kernel(program, name), False

    def __call__(
        self,
        queue: cl.CommandQueue,
        items: tuple[int, ...],
        group: tuple[int, ...] | None,
        *arguments: object,
    ) -> cl.Event:
        """Start so many work items, in groups.

        arguments  buffers, local memory, NumPy scalars, and arrays for vectors
        """
        if not self._typed:
            self._kernel.set_arg_types([_type(argument) for argument in arguments])
            self._typed = True
        return self._kernel(queue, items, group, *arguments)


def _type(argument: object) -> np.dtype | None:
    """Return what an argument's bits are: a number, a vector's bytes, or None for memory."""
    if isinstance(argument, np.generic):
        return argument.dtype
    return np.dtype((np.void, argument.nbytes)) if isinstance(argument, np.ndarray) else None
