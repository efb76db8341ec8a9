"""The log: what bakes and tests told, what went wrong, and what the worker process printed."""

from __future__ import annotations

from datetime import datetime

from .user_files import append_to_log
from .worker_manager import owner


def log(text: str) -> None:
    """Write a message with the time, then what the worker has printed since the last one."""
    time = datetime.now().astimezone().isoformat(" ", "seconds")
    append_to_log(f"{time}  {_indented(text)}")
    printed = owner.printed()
    if printed:
        append_to_log(f"{time}  The worker printed: {_indented(printed)}")


def _indented(text: str) -> str:
    """Return lines of which all but the first are indented."""
    return "\n    ".join(text.strip().splitlines()) + "\n"
