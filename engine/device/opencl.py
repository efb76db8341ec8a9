"""Lazy access to PyOpenCL: imported at the first use, since machines without it bake with OpenGL.

Its generated launch code is kept in memory.
"""

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


class InvokerCache:
    """Replacement for PyOpenCL's database of generated launch code.

    The code depends on all parts of its key except the first, the kernel's name. Kernels with equal argument
    types therefore share it, since Python takes 0.5 ms to compile it. PyOpenCL's message about a wrong number
    of arguments may name another kernel.
    """

    def __init__(self, *_names: str, **_options: object) -> None:
        self._made: dict[tuple, Any] = {}

    def __getitem__(self, key: tuple) -> Any:
        return self._made[key[1:]]

    def store_if_not_present(self, key: tuple, value: object) -> None:
        """Store a value if the key is new, like the database."""
        self._made.setdefault(key[1:], value)


def keep_starters_in_memory() -> None:
    """Let PyOpenCL keep generated launch code in memory.

    Otherwise it opens a database in the user's cache folder, which no setting disables. The file would stay
    behind when the add-on is removed, and deleting it would break all later bakes.
    """
    load_opencl()
    persistent_dict: Any = importlib.import_module("pytools.persistent_dict")
    name = "WriteOncePersistentDict"
    database = getattr(persistent_dict, name)
    setattr(persistent_dict, name, InvokerCache)
    try:
        importlib.import_module("pyopencl.invoker")
    finally:
        setattr(persistent_dict, name, database)
