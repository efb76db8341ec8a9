"""Progress of a bake in the terminal, for Blender without a window."""

from __future__ import annotations

import time

from ..engine.progress import Progress
from .report_message import progress_line

#: Time between two lines, s, chosen; shorter bakes print no line.
_PERIOD = 1.0


class Console:
    """Printer of progress lines, at most one per _PERIOD."""

    def __init__(self) -> None:
        self._next = time.perf_counter() + _PERIOD

    def show(self, progress: Progress) -> None:
        """Print the progress if enough time has passed since the last line."""
        now = time.perf_counter()
        if now >= self._next:
            self._next = now + _PERIOD
            print(progress_line(progress), flush=True)  # noqa: T201
