"""The Python that PyOpenCL generates to start kernels: kept in memory, and nowhere else."""

from __future__ import annotations

import importlib
from typing import Any

from .opencl import load_opencl


class InvokerCache:
    """Stands in for the database in which PyOpenCL keeps what it has generated.

    What starts a kernel depends on all but the first item of its key, the name, so that kernels with like
    arguments share it: Python takes half a millisecond to compile it. What PyOpenCL says of a wrong number of
    arguments may have the name of another one.
    """

    def __init__(self, *_names: str, **_options: object) -> None:
        self._made: dict[tuple, Any] = {}

    def __getitem__(self, key: tuple) -> Any:
        return self._made[key[1:]]

    def store_if_not_present(self, key: tuple, value: object) -> None:
        """Keep a value, as the database does."""
        self._made.setdefault(key[1:], value)


def keep_starters_in_memory() -> None:
    """Have PyOpenCL keep what it generates to start kernels in this process.

    It would open a database in the user's cache folder when this module of its is imported, for which it has
    no setting: the file would stay behind when the add-on is removed, and all bakes fail once it is deleted.
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
