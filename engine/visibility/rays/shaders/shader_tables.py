"""Arrays of several types in one storage block: OpenGL 4.3 guarantees only 8 blocks to a compute shader."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl
import numpy as np

from ....device.gl_context import GraphicsContext
from ....errors import DeviceMemoryError


class ShaderTables:
    """Arrays one after another in a buffer of 32-bit words.

    buffer:    the words
    uniforms:  first_<name>: the word at which an array begins
    """

    def __init__(self, graphics: GraphicsContext, arrays: Mapping[str, np.ndarray]) -> None:
        """Upload arrays of 4-byte numbers or records by their names."""
        words, self.uniforms, first = [], dict[str, int](), 0
        for name, array in arrays.items():
            part = np.ascontiguousarray(array).reshape(-1).view(np.uint32)
            words.append(part)
            self.uniforms[f"first_{name}"] = first
            first += len(part)
        self.buffer = storage_buffer(graphics, np.concatenate([*words, np.zeros(1, np.uint32)]))


def storage_buffer(graphics: GraphicsContext, array: np.ndarray) -> moderngl.Buffer:
    """Return a buffer with an array; see `reserve_storage`."""
    return reserve_storage(graphics, array.nbytes, array.tobytes())


def reserve_storage(graphics: GraphicsContext, size: int, data: bytes = b"") -> moderngl.Buffer:
    """Return a buffer of a size, bytes, that begins with `data`.

    Raises DeviceMemoryError if no storage block of the driver may be as large.
    """
    largest = largest_block(graphics)
    if size > largest:
        raise DeviceMemoryError(
            f"'{graphics.name}' takes blocks of {largest / 2**20:.0f} MiB, and this bake needs one of "
            f"{size / 2**20:.0f} MiB without OpenCL. Install an OpenCL driver, or bake fewer objects at once."
        )
    if size <= len(data):
        return graphics.context.buffer(data.ljust(16, b"\0"))
    return graphics.context.buffer(reserve=max(size, 16))


def largest_block(graphics: GraphicsContext) -> int:
    """Return the largest storage block of a driver, bytes."""
    return int(graphics.context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
