"""Atlases of xatlas that are destroyed only once their threads sleep.

An Atlas starts a thread for each core. To end them its destructor sets a flag of each thread without the
thread's mutex and notifies it: a thread that has just read the flag but does not sleep yet misses this, and
the destructor waits for it for ever (seen once in 20,000 atlases of xatlas 0.0.11). Threads sleep within
microseconds of the last work, so an Atlas that has rested for a while is safe to destroy.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from contextlib import contextmanager
from typing import Any

#: How long an atlas rests before it is destroyed, s.
REST = 0.05


class RestingAtlases:
    """Makes atlases and destroys them after a rest.

    make  returns a new `xatlas.Atlas`
    """

    def __init__(self, make: Callable[[], Any]) -> None:
        self._make = make
        self._resting: deque[tuple[float, Any]] = deque()

    @contextmanager
    def atlas(self):
        """Give an atlas to work with; it rests afterwards."""
        self._destroy_rested()
        atlas = self._make()
        try:
            yield atlas
        finally:
            self._resting.append((time.monotonic(), atlas))

    def destroy(self) -> None:
        """Destroy all atlases; waits until the last has rested."""
        if self._resting:
            since, _ = self._resting[-1]
            time.sleep(max(0.0, since + REST - time.monotonic()))
            self._resting.clear()

    def _destroy_rested(self) -> None:
        """Destroy the atlases that have rested long enough."""
        while self._resting and self._resting[0][0] + REST < time.monotonic():
            self._resting.popleft()
