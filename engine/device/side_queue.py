"""Side queue: a second OpenCL queue for a thread that works parallel to the bake."""

from __future__ import annotations

import numpy as np

from .kernel import Kernel, run_on
from .opencl import cl


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
