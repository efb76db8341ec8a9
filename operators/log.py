"""Log file: results of bakes and tests, errors, and the output of the worker process."""

from __future__ import annotations

from datetime import datetime

from .user_files import append_to_log
from .worker_manager import owner


def log(text: str) -> None:
    """Append a message with the time, and the output of the worker since the last message."""
    time = datetime.now().astimezone().isoformat(" ", "seconds")
    append_to_log(f"{time}  {_indented(text)}")
    printed = owner.printed()
    if printed:
        append_to_log(f"{time}  The worker printed: {_indented(printed)}")


def _indented(text: str) -> str:
    """Return the lines of a text, indented from the second line on."""
    return "\n    ".join(text.strip().splitlines()) + "\n"
