"""In-memory cache for the launch code that PyOpenCL generates."""

from __future__ import annotations

import importlib
from typing import Any

from .opencl import load_opencl


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
