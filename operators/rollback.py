"""Rollback of the changes of a run."""

from __future__ import annotations

from collections.abc import Callable


class Rollback:
    """List of functions that undo changes, called in reverse order.

    Each function must search for its datablocks (see `lookup`) and do nothing if they no longer exist.
    """

    def __init__(self) -> None:
        self._steps: list[Callable[[], object]] = []

    def add(self, step: Callable[[], object]) -> None:
        """Add a function that undoes the change just made."""
        self._steps.append(step)

    def undo(self) -> None:
        """Undo all changes, the latest first."""
        while self._steps:
            self._steps.pop()()
