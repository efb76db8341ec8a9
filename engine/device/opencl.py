"""Lazy access to PyOpenCL: imported at the first use, since machines without it bake with OpenGL."""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

from ..errors import DeviceError
from .packages import missing_package

__all__ = ["cl", "load_opencl"]


class _LazyModule:
    """Stand-in for PyOpenCL. It forwards attributes and keeps none, so that tests can replace them."""

    def __init__(self) -> None:
        self._package: ModuleType | None = None

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the package; raises DeviceError if that cannot be imported."""
        # A package that another thread still imports is in `sys.modules` already: the import waits for it.
        if self._package is None or sys.modules.get("pyopencl") is not self._package:
            self._package = load_opencl()
        return getattr(self._package, name)


def load_opencl() -> ModuleType:
    """Import PyOpenCL; raises DeviceError if the package cannot be imported."""
    try:
        return importlib.import_module("pyopencl")
    except ImportError as error:
        raise DeviceError(missing_package("pyopencl", error)) from error


if TYPE_CHECKING:
    import pyopencl as cl
else:
    cl = _LazyModule()
