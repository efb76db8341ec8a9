"""Where PyOpenCL keeps the Python it generates to start kernels: a cache that goes with the add-on."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager

import platformdirs


def keep_starters_in(folder: str) -> None:
    """Have PyOpenCL keep what it generates to start kernels in a folder, if it has not opened its cache yet.

    It opens the cache once, when this module of its is imported, and has no setting for its folder; in the
    user's cache folder it would stay behind when the add-on is removed.
    """
    with _user_cache_dir(folder):
        importlib.import_module("pyopencl.invoker")


@contextmanager
def _user_cache_dir(folder: str) -> Iterator[None]:
    """Make a folder the user's cache folder for who asks within `with`."""
    original = platformdirs.user_cache_dir
    platformdirs.user_cache_dir = lambda *names, **options: folder
    try:
        yield
    finally:
        platformdirs.user_cache_dir = original
