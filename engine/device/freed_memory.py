"""Memory that a bake has freed stays with the process: pages need not be mapped anew by the next one."""

from __future__ import annotations

import ctypes
import sys

#: Parameters of mallopt (glibc, malloc.h): free memory at the end of the heap that is given back, and how
#: many blocks are mapped apart, which are given back as soon as they are freed.
_TRIM_THRESHOLD, _MMAP_MAX = -1, -4

#: Free memory that the process keeps at most while it works, bytes.
_KEPT = (1 << 31) - 1


def keep_freed_memory() -> None:
    """Let the C library keep what is freed, where it is glibc; others decide for themselves."""
    library = _glibc()
    if library is not None:
        library.mallopt(_TRIM_THRESHOLD, _KEPT)
        library.mallopt(_MMAP_MAX, 0)


def give_back_freed_memory() -> None:
    """Give what is free back to the system."""
    library = _glibc()
    if library is not None:
        library.malloc_trim(0)


def _glibc() -> ctypes.CDLL | None:
    """Return this process's glibc, None if it runs on another C library."""
    if not sys.platform.startswith("linux"):
        return None
    library = ctypes.CDLL(None)
    return library if hasattr(library, "gnu_get_libc_version") else None
