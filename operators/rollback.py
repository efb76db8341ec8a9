"""What a run has changed so far, so that it can be taken back."""

from __future__ import annotations

from collections.abc import Callable


class Rollback:
    """A list of steps that undo what was done, run in reverse order.

    A step looks its datablocks up itself (see `lookup`) and does nothing if they are gone.
    """

    def __init__(self) -> None:
        self._steps: list[Callable[[], None]] = []

    def add(self, step: Callable[[], None]) -> None:
        """Remember how to take back what has just been done."""
        self._steps.append(step)

    def undo(self) -> None:
        """Undo everything, the latest first."""
        while self._steps:
            self._steps.pop()()
