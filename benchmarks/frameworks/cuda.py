"""CUDA through CuPy, used by this comparison only."""

from __future__ import annotations

from typing import Any

import numpy as np

from .framework import MissingError
from .kernel_texts import KernelText, cuda_text


class CUDA:
    """See `framework.Framework`; raises MissingError without CuPy or a device."""

    name = "CUDA"

    def __init__(self) -> None:
        try:
            import cupy
        except ImportError as error:
            raise MissingError("CuPy is not installed") from error
        try:
            properties = cupy.cuda.runtime.getDeviceProperties(0)
        except cupy.cuda.runtime.CUDARuntimeError as error:
            raise MissingError(f"no device: {error}") from error
        self._cupy, self.device = cupy, properties["name"].decode()

    def upload(self, values: np.ndarray) -> Any:
        """Return memory of the device with the bits of an array."""
        return self._cupy.asarray(values)

    def refill(self, memory: Any, values: np.ndarray) -> None:
        """Copy an array of the same size to the device, and wait for it."""
        memory.set(values)
        self.finish()

    def download(self, memory: Any, shape: tuple[int, ...]) -> np.ndarray:
        """Return float32 from the device in a shape."""
        values: np.ndarray = memory.get().view(np.float32).reshape(shape)
        return values

    def build(self, kernel: KernelText, items: int) -> tuple[Any, int]:
        """Return a kernel for groups of `items`."""
        return self._cupy.RawKernel(cuda_text(kernel, items), kernel.name), items

    def start(self, built: tuple[Any, int], groups: int, inputs: tuple, result: Any, count: int) -> None:
        """Start a kernel; do not wait for it."""
        kernel, items = built
        kernel((groups,), (items,), (*inputs, result, np.int32(count)))

    def finish(self) -> None:
        """Wait until all that was started is done."""
        self._cupy.cuda.Device().synchronize()
