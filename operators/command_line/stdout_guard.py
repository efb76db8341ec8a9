"""Reserves standard output for the result of a command."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def quiet_stdout() -> Iterator[None]:
    """Redirect standard output of C code and Python to standard error."""
    _flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        _flush()
        os.dup2(kept, 1)
        os.close(kept)


def end_stdout() -> None:
    """Redirect further output of the process to standard error, since Blender prints when it exits."""
    _flush()
    os.dup2(2, 1)


def _flush() -> None:
    """Flush Python's and the C library's buffers; into a pipe, Blender's lines come only at the end."""
    sys.stdout.flush()
    library = ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None)
    library.fflush(None)
