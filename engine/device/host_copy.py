"""Copy of hemicubes from OpenGL to OpenCL through host memory, once for each batch."""

from __future__ import annotations

import moderngl
import numpy as np

from .cl_device import ComputeDevice
from .opencl import cl


class HostCopy:
    """OpenCL buffer with a copy of an OpenGL texture array.

    The array is (layers, height, width, 4) float32, or (layers, height, width) uint32, in both.
    """

    def __init__(self, compute: ComputeDevice, texture: moderngl.TextureArray) -> None:
        width, height, layers = texture.size
        self._queue = compute.queue
        self._texture = texture
        numbers = texture.components
        self._shape = (layers, height, width, numbers) if numbers > 1 else (layers, height, width)
        self._dtype = np.uint32 if texture.dtype == "u4" else np.float32
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.ALLOC_HOST_PTR
        self.buffer = cl.Buffer(compute.context, flags, size=int(np.prod(self._shape)) * 4)

    def update(self) -> cl.Buffer:
        """Read the texture array into the mapped buffer; return the buffer."""
        mapped, _ = cl.enqueue_map_buffer(
            self._queue, self.buffer, cl.map_flags.WRITE, 0, self._shape, self._dtype
        )
        try:
            self._texture.read_into(mapped)
        finally:
            mapped.base.release(self._queue)
        return self.buffer

    def release(self) -> None:
        """Do nothing, since OpenCL frees the buffer."""
