"""The devices of a bake: an OpenGL context to draw with, an OpenCL device to compute with."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

from ..errors import DeviceError, DeviceMemoryError
from .async_open import AsyncOpen
from .cl_device import ComputeDevice
from .gl_context import GraphicsContext
from .opencl import cl

#: What OpenCL says of a buffer that is larger than any may be.
_TOO_LARGE = "INVALID_BUFFER_SIZE"


class Devices:
    """Both devices, with what was built for them; they may serve several bakes, one after the other.

    cache_dir, opencl_device  as in `Settings`
    opening    of the OpenCL device, if it has begun
    compute    None if there is no OpenCL; `missing` then tells why and the remedy

    Raises DeviceError if there is no OpenGL, or if the chosen OpenCL device is not there or does not work.
    """

    def __init__(
        self,
        cache_dir: str | None = None,
        opencl_device: str | None = None,
        opening: AsyncOpen | None = None,
    ) -> None:
        self.cache_dir, self.opencl_device, self.missing = cache_dir, opencl_device, ""
        self.compute: ComputeDevice | None = None
        try:
            self.compute = opening.compute() if opening else ComputeDevice(cache_dir, opencl_device)
        except DeviceError as error:
            if opencl_device is not None:
                raise
            self.missing = str(error)

        # OpenGL comes second: programs are built meanwhile.
        try:
            self.graphics = GraphicsContext()
        except BaseException:
            self._release_compute()
            raise

    @staticmethod
    def begin_opening(cache_dir: str | None, opencl_device: str | None) -> AsyncOpen:
        """Begin to open an OpenCL device for devices of the same parameters."""
        return AsyncOpen(lambda ahead: ComputeDevice(cache_dir, opencl_device, ahead=ahead))

    @property
    def on_card(self) -> bool:
        """True if a graphics card computes, False if a processor does."""
        return self.compute is not None and not self.compute.processor

    @contextmanager
    def failures_told(self) -> Iterator[None]:
        """Turn into a DeviceError what OpenGL refuses, and that the memory of the OpenCL device is full."""
        try:
            yield
        except moderngl.Error:
            self.graphics.check("preparing to draw")
            raise
        except Exception as error:
            if self.compute is None or not _is_memory_error(error):
                raise
            size = self.compute.device.global_mem_size / 2**30
            raise DeviceMemoryError(
                f"The {size:.1f} GiB of '{self.compute.name}' are not enough for this bake ({error}). "
                "Lower the resolution, bake fewer objects at once, or close programs that use the device."
            ) from error

    def clear(self) -> None:
        """Free what the last bake left on the devices, but keep contexts, shaders and kernels."""
        self.graphics.clear()

    def release(self) -> None:
        """Free everything."""
        self.graphics.release()
        self._release_compute()

    def _release_compute(self) -> None:
        if self.compute is not None:
            self.compute.release()


def _is_memory_error(error: Exception) -> bool:
    """Return True if OpenCL reports that memory is full, or a buffer larger than any may be."""
    too_large = isinstance(error, cl.Error) and _TOO_LARGE in str(error)
    return isinstance(error, cl.MemoryError) or too_large
