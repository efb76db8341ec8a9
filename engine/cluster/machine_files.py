"""Files in the memory of the client's machine, for workers that have other memory: others read and write.

A worker in a container may join a bake that began with files: it has their contents through Dask, from a
worker that sees them.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from distributed import get_client, get_worker

from ..errors import DeviceError
from .memory_folder import is_at_hand


def file_bytes(path: str, first: int = 0, size: int = -1) -> bytes:
    """Return bytes of a file, from another worker unless this one sees it.

    Called in tasks alone; raises DeviceError if no worker sees the file.

    size: how many from the first one on; -1 for all
    """
    if is_at_hand(str(Path(path).parent)):
        return _read(path, first, size)
    return bytes(by_other(path, _read, path, first, size))


def by_other(path: str, function: Callable[..., Any], *arguments: object) -> Any:
    """Have another worker, which sees a file, call a function; return the result.

    Called in tasks alone; raises DeviceError if no worker sees the file.

    arguments: of Python itself
    """
    worker, client = get_worker(), get_client()
    seen = client.run(is_at_hand, str(Path(path).parent), on_error="ignore")
    for address in (address for address, sees in seen.items() if sees):
        results = client.run(function, *arguments, workers=[address], on_error="ignore")
        if address in results:
            return results[address]
    raise DeviceError(
        f"Worker '{worker.name}' at {worker.address} has other memory than the machine that the bake was "
        "begun on, as in a container, and every worker is gone that had the same. Bake again."
    )


def _read(path: str, first: int, size: int) -> bytes:
    with Path(path).open("rb") as file:
        file.seek(first)
        return file.read(size)
