"""Standard output for nothing but the result of a command."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def quiet_stdout() -> Iterator[None]:
    """Send what C code and Python print on standard output to standard error."""
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
    """Send what the process still prints to standard error: Blender prints when it exits."""
    _flush()
    os.dup2(2, 1)


def _flush() -> None:
    """Write what Python and the C library hold back: into a pipe Blender's own lines come only at its end."""
    sys.stdout.flush()
    library = ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None)
    library.fflush(None)
