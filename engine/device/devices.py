"""Devices of a bake: an OpenGL context for drawing and an OpenCL device for computing."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from types import TracebackType

import moderngl

from ..errors import DeviceError, DeviceMemoryError
from .cl_device import ComputeDevice
from .gl_context import GraphicsContext
from .opencl import cl
from .peers import Peers, has_equals, open_peers
from .planned_program import PlannedProgram

#: Text in the OpenCL error for a buffer above the maximum size.
_TOO_LARGE = "INVALID_BUFFER_SIZE"


class Devices:
    """Both devices with their programs; they may serve several bakes in sequence.

    cache_dir, opencl_device:  see `Settings`
    opening:                   OpenCL device that is being opened; None to open it here
    compute:                   OpenCL device; None if there is none, and then `missing` holds reason and
                               remedy

    Raises DeviceError without OpenGL, or if the chosen OpenCL device is missing or fails.
    """

    def __init__(
        self,
        cache_dir: str | None = None,
        opencl_device: str | None = None,
        opening: AsyncOpen | None = None,
    ) -> None:
        self.cache_dir, self.opencl_device, self.missing = cache_dir, opencl_device, ""
        self.compute: ComputeDevice | None = None
        self._peers: Peers | None = None
        try:
            self.compute = opening.compute() if opening else ComputeDevice(cache_dir, opencl_device)
        except DeviceError as error:
            if opencl_device is not None:
                raise
            self.missing = str(error)

        # OpenGL opens while OpenCL builds programs in the background.
        try:
            self.graphics = GraphicsContext()
        except BaseException:
            self._release_compute()
            raise

    @staticmethod
    def begin_opening(cache_dir: str | None, opencl_device: str | None) -> AsyncOpen:
        """Start to open an OpenCL device for these parameters."""
        return AsyncOpen(lambda ahead: ComputeDevice(cache_dir, opencl_device, ahead=ahead))

    @property
    def has_peers(self) -> bool:
        """True if this machine has other GPUs of the same model; opens none."""
        return self.compute is not None and has_equals(self.compute)

    def peers(self) -> Peers:
        """Return the other GPUs of the same model, opened on first use."""
        if self._peers is None:
            self._peers = open_peers(self.compute, self.cache_dir) if self.compute else Peers()
        return self._peers

    @contextmanager
    def translated_failures(self) -> Iterator[None]:
        """Convert OpenGL errors and OpenCL memory errors inside the block to DeviceError."""
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
        """Release the data of the last bake, but keep contexts and programs."""
        self.graphics.clear()
        for peer in self._peers.opened if self._peers else ():
            peer.thread.end()

    def release(self) -> None:
        """Release everything."""
        self.graphics.release()
        self._release_compute()

    def _release_compute(self) -> None:
        for compute in (self.compute, *(self._peers.opened if self._peers else ())):
            if compute is not None:
                compute.release()


def _is_memory_error(error: Exception) -> bool:
    """Return True if OpenCL reports full memory or a buffer above the maximum size."""
    too_large = isinstance(error, cl.Error) and _TOO_LARGE in str(error)
    return isinstance(error, cl.MemoryError) or too_large


class AsyncOpen:
    """Opens an OpenCL device in a thread; as a context manager it releases the device after an error.

    open_device:  opens the device, given the programs to build ahead
    """

    def __init__(self, open_device: Callable[[Iterator[PlannedProgram]], ComputeDevice]) -> None:
        self._ahead, self._compute = Future[Sequence[PlannedProgram]](), Future[ComputeDevice]()
        threading.Thread(target=self._open, args=[open_device], name="opening", daemon=True).start()

    def __enter__(self) -> AsyncOpen:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            return
        if not self._ahead.done():
            self._ahead.set_result(())
        with suppress(BaseException):
            self.compute().release()

    def build_ahead(self, programs: Sequence[PlannedProgram]) -> None:
        """Pass the programs to build before the first bake to the thread, which waits for this call.

        Call it once.
        """
        self._ahead.set_result(programs)

    def compute(self) -> ComputeDevice:
        """Return the device once it is open; re-raise the error of `open_device`."""
        return self._compute.result()

    def _open(self, open_device: Callable[[Iterator[PlannedProgram]], ComputeDevice]) -> None:
        try:
            self._compute.set_result(open_device(self._programs()))
        except BaseException as error:  # noqa: BLE001 - the caller of `compute` gets it
            self._compute.set_exception(error)

    def _programs(self) -> Iterator[PlannedProgram]:
        """Yield the programs of `build_ahead` once they are set."""
        yield from self._ahead.result()
