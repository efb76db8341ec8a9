"""Access to files in the client's memory from workers without that memory, through other workers.

A worker in a container may join a bake that uses shared files. It receives their contents through Dask, from
a worker that can read them.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from distributed import get_client, get_worker

from ..errors import DeviceError
from .memory_folder import is_at_hand


def file_bytes(path: str, first: int = 0, size: int = -1) -> bytes:
    """Return bytes of a file, read by another worker if this one has no access.

    Call only in tasks. Raises DeviceError if no worker has access.

    size: number of bytes from `first` on; -1 for all
    """
    if is_at_hand(str(Path(path).parent)):
        return _read(path, first, size)
    return bytes(by_other(path, _read, path, first, size))


def by_other(path: str, function: Callable[..., Any], *arguments: object) -> Any:
    """Call a function on another worker that has access to a file; return the result.

    Call only in tasks. Raises DeviceError if no worker has access.

    arguments: built-in Python types only
    """
    worker, client = get_worker(), get_client()
    seen = client.run(is_at_hand, str(Path(path).parent), on_error="ignore")
    for address in (address for address, sees in seen.items() if sees):
        results = client.run(function, *arguments, workers=[address], on_error="ignore")
        if address in results:
            return results[address]
    raise DeviceError(
        f"Worker '{worker.name}' at {worker.address} shares no memory with the machine that started "
        "the bake, as in a container, and no other worker shares it. Bake again."
    )


def _read(path: str, first: int, size: int) -> bytes:
    with Path(path).open("rb") as file:
        file.seek(first)
        return file.read(size)
