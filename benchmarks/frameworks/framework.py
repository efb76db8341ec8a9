"""Interface of a timed framework."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from .kernel_texts import KernelText


class MissingError(Exception):
    """A framework, or a device for it, is not there; says why."""


class Framework(Protocol):
    """A way to run kernels on a device.

    name:    of the framework
    device:  its own name for the device
    """

    name: str
    device: str

    def upload(self, values: np.ndarray) -> Any:
        """Return memory of the device with the bits of an array."""

    def refill(self, memory: Any, values: np.ndarray) -> None:
        """Copy an array of the same size to the device, and wait for it."""

    def download(self, memory: Any, shape: tuple[int, ...]) -> np.ndarray:
        """Return float32 from the device in a shape."""

    def build(self, kernel: KernelText, items: int) -> Any:
        """Return a kernel for groups of `items`."""

    def start(self, built: Any, groups: int, inputs: tuple, result: Any, count: int) -> None:
        """Start a kernel; do not wait for it."""

    def finish(self) -> None:
        """Wait until all that was started is done."""
