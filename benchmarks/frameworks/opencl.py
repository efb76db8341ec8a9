"""OpenCL, by PyOpenCL."""

from __future__ import annotations

import numpy as np
import pyopencl as cl

from engine.device.cl_device import ComputeDevice

from .kernel_texts import KernelText, opencl_text


class OpenCL:
    """See `framework.Framework`; the device is the one that bakes take."""

    name = "OpenCL"

    def __init__(self) -> None:
        compute = ComputeDevice()
        self._context, self._queue, self.device = compute.context, compute.queue, compute.name

    def upload(self, values: np.ndarray) -> cl.Buffer:
        """Return memory of the device with the bits of an array."""
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self._context, flags, hostbuf=values)

    def refill(self, memory: cl.Buffer, values: np.ndarray) -> None:
        """Copy an array of the same size to the device, and wait for it."""
        cl.enqueue_copy(self._queue, memory, values, is_blocking=True)

    def download(self, memory: cl.Buffer, shape: tuple[int, ...]) -> np.ndarray:
        """Return float32 from the device in a shape."""
        values = np.empty(shape, np.float32)
        cl.enqueue_copy(self._queue, values, memory, is_blocking=True)
        return values

    def build(self, kernel: KernelText, items: int) -> tuple[cl.Kernel, int]:
        """Return a kernel for groups of `items`."""
        program = cl.Program(self._context, opencl_text(kernel, items)).build(cache_dir=False)
        built = cl.Kernel(program, kernel.name)
        built.set_arg_types([None] * (len(kernel.inputs) + 1) + [np.dtype(np.int32)])
        return built, items

    def start(
        self, built: tuple[cl.Kernel, int], groups: int, inputs: tuple, result: cl.Buffer, count: int
    ) -> None:
        """Start a kernel; do not wait for it."""
        kernel, items = built
        kernel(self._queue, (groups * items,), (items,), *inputs, result, np.int32(count))

    def finish(self) -> None:
        """Wait until all that was started is done."""
        self._queue.finish()
