"""What a thread has of the OpenCL device while another one bakes."""

from __future__ import annotations

import numpy as np

from .kernel import Kernel, run_on
from .opencl import cl


class SideQueue:
    """A kernel that no other thread starts, and a queue beside that of the bake.

    A kernel holds the arguments of one start: threads that share it would mix theirs.
    """

    def __init__(self, queue: cl.CommandQueue, kernel: Kernel) -> None:
        self._queue, self._kernel = queue, kernel

    def run(self, items: int, *arguments: object, layers: int = 1) -> None:
        """Run the kernel for at least `items` work items of each layer; it has to ignore those beyond."""
        run_on(self._queue, self._kernel, items, *arguments, layers=layers)

    def upload(self, values: np.ndarray) -> cl.Buffer:
        """Return a buffer with the bits of an array, which is not empty."""
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self._queue.context, flags, hostbuf=np.ascontiguousarray(values))

    def room_for(self, size: int) -> cl.Buffer:
        """Return a buffer of this many bytes, one at least."""
        return cl.Buffer(self._queue.context, cl.mem_flags.READ_WRITE, size)

    def download(self, values: np.ndarray, buffer: cl.Buffer) -> None:
        """Fill an array with the bits of a buffer, once all work before is done."""
        if values.nbytes:
            cl.enqueue_copy(self._queue, values, buffer)
