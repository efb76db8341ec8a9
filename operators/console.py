"""Tells a terminal how far a bake is: where no window shows it."""

from __future__ import annotations

import time

from ..engine.progress import Progress
from .report_message import progress_line

#: Time between two lines, s: shorter bakes print none.
_PERIOD = 1.0


class Console:
    """Prints a line about a bake from time to time."""

    def __init__(self) -> None:
        self._next = time.perf_counter() + _PERIOD

    def show(self, progress: Progress) -> None:
        """Print the progress if enough time has passed since the last line."""
        now = time.perf_counter()
        if now >= self._next:
            self._next = now + _PERIOD
            print(progress_line(progress), flush=True)  # noqa: T201
