"""Heap settings that keep freed memory in the process, so that the next bake need not map pages again."""

from __future__ import annotations

import ctypes
import sys

#: Parameters of glibc's mallopt (malloc.h): M_TRIM_THRESHOLD and M_MMAP_MAX.
_TRIM_THRESHOLD, _MMAP_MAX = -1, -4

#: Maximum free memory that the process keeps, bytes.
_KEPT = (1 << 31) - 1


def keep_freed_memory() -> None:
    """Let glibc keep freed memory; other C libraries are left alone."""
    library = _glibc()
    if library is not None:
        library.mallopt(_TRIM_THRESHOLD, _KEPT)
        library.mallopt(_MMAP_MAX, 0)


def give_back_freed_memory() -> None:
    """Return free memory to the system."""
    library = _glibc()
    if library is not None:
        library.malloc_trim(0)


def _glibc() -> ctypes.CDLL | None:
    """Return glibc, or None if the process uses another C library."""
    if not sys.platform.startswith("linux"):
        return None
    library = ctypes.CDLL(None)
    return library if hasattr(library, "gnu_get_libc_version") else None
