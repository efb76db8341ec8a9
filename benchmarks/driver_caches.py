"""Caches of drivers in a folder of their own, so that a measurement begins without compiled programs."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

#: Environment variables of the folders in which drivers keep programs: NVIDIA's, PoCL, and OpenGL drivers.
_FOLDERS = ("CUDA_CACHE_PATH", "POCL_CACHE_DIR", "XDG_CACHE_HOME", "__GL_SHADER_DISK_CACHE_PATH")


@contextmanager
def driver_caches(folder: str) -> Iterator[None]:
    """Let drivers of processes that start meanwhile use subfolders of a folder as their caches."""
    before = {name: os.environ.get(name) for name in _FOLDERS}
    for name in _FOLDERS:
        os.environ[name] = os.path.join(folder, name)
        os.makedirs(os.environ[name], exist_ok=True)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name)
            os.environ.update({} if value is None else {name: value})
