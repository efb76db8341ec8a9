"""The devices of a bake: an OpenGL context to draw with, an OpenCL device to compute with."""

from __future__ import annotations

from ..errors import DeviceError
from .compute import Compute
from .graphics import Graphics


class Devices:
    """Both devices, with what was built for them; they may serve several bakes, one after the other.

    cache_dir  see `Settings.cache_dir`
    compute    None if there is no OpenCL; `missing` then tells why and the remedy

    Raises DeviceError if there is no OpenGL.
    """

    def __init__(self, cache_dir: str | None = None) -> None:
        self.graphics = Graphics()
        self.cache_dir, self.missing = cache_dir, ""
        self.compute: Compute | None = None
        try:
            self.compute = Compute(cache_dir)
        except DeviceError as error:
            self.missing = str(error)

    def clear(self) -> None:
        """Free what the last bake left on the devices, but keep contexts, shaders and kernels."""
        self.graphics.clear()

    def release(self) -> None:
        """Free everything."""
        self.graphics.release()
