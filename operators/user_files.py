"""Files in Blender's user folder, which uninstalling removes.

They are compiled kernels, checkpoints of interrupted bakes, a log, and the measured speed of this machine.
"""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import bpy

from ..engine.resume.checkpoint_folder import CheckpointFolder
from .extension import EXTENSION

#: Size in bytes at which the log becomes the old log and a new one begins (chosen).
_LOG_LIMIT = 1 << 20


def cache_folder() -> Path | None:
    """Return the folder of compiled kernels and checkpoints, None if it cannot be created."""
    return _folder("cl_cache")


def cache_size() -> int:
    """Return the size of the cache, bytes."""
    folder = cache_folder()
    files = folder.rglob("*") if folder else ()
    size = 0
    for path in files:
        with suppress(OSError):
            size += path.lstat().st_size if path.is_file() else 0
    return size


def kept_checkpoint_since(time: float) -> bool:
    """Return True if a bake has written a checkpoint since `time`, seconds as from `time.time`."""
    folder = cache_folder()
    return folder is not None and CheckpointFolder(str(folder), 1).written_since(time)


def clear_cache() -> None:
    """Delete all files of the cache; raises OSError for a file that cannot be deleted."""
    folder = cache_folder()
    for path in folder.iterdir() if folder else ():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()


def log_file() -> Path | None:
    """Return the path of the log, None if its folder cannot be created."""
    folder = _folder("log")
    return None if folder is None else folder / "hemibake.log"


def append_to_log(text: str) -> None:
    """Append a text to the log; errors of the file system are ignored."""
    path = log_file()
    if path is None:
        return
    with suppress(OSError):
        if path.exists() and path.stat().st_size > _LOG_LIMIT:
            path.replace(path.with_suffix(".old.log"))
        with path.open("a", encoding="utf-8") as file:
            file.write(text)


def read_paces() -> dict[str, float]:
    """Return the paces of earlier bakes, seconds per unit of work by stage; empty without a valid file."""
    path = _paces_file()
    if path is None:
        return {}
    with suppress(OSError, ValueError, AttributeError):
        known = json.loads(path.read_text(encoding="utf-8"))
        return {str(name): float(pace) for name, pace in known.items() if 0 < float(pace) < math.inf}
    return {}


def keep_paces(paces: Mapping[str, float]) -> None:
    """Store paces for later sessions; errors of the file system are ignored."""
    path = _paces_file()
    with suppress(OSError):
        if path is not None:
            path.write_text(json.dumps(dict(paces), indent=1), encoding="utf-8")


def _paces_file() -> Path | None:
    folder = _folder("paces")
    return None if folder is None else folder / "paces.json"


def _folder(name: str) -> Path | None:
    """Return a folder of the extension, created if it is missing; None if that fails."""
    try:
        return Path(bpy.utils.extension_path_user(EXTENSION, path=name, create=True))
    except (ValueError, OSError):
        return None
