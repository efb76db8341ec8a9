"""Range of rows from which several devices take slices."""

from __future__ import annotations

import threading
from collections.abc import Generator, Iterable

#: Slices that each device takes at least of the rows that are left, so that all devices finish together
#: (chosen).
_SHARES = 2


class RowRange:
    """Rows first <= i < last; the first device takes them from the front, the others from the end.

    takers:   number of devices; with one, `take` returns all that is wanted
    stopped:  True after `stop`; work on slices that have been taken ends soon
    """

    def __init__(self, first: int, last: int, takers: int = 1) -> None:
        self._first, self._last, self._takers = first, last, takers
        self._count = max(last - first, 1)
        self._lock = threading.Lock()
        self.stopped = False

    @property
    def left(self) -> int:
        """Number of rows that no device has taken."""
        return self._last - self._first

    def take(self, wanted: int, least: int, from_end: bool = False) -> tuple[int, int] | None:
        """Return the first row and the end of a slice; None if no row is left.

        wanted:  maximum number of rows
        least:   minimum number of rows of a slice among several devices, if so many are left
        """
        with self._lock:
            if self._takers > 1:
                wanted = min(wanted, max(least, self.left // (_SHARES * self._takers)))
            size = min(wanted, self.left)
            if size <= 0:
                return None
            if from_end:
                self._last -= size
                return self._last, self._last + size
            self._first += size
            return self._first - size, self._first

    def progress(self, work: Iterable[object]) -> Generator[float, None, None]:
        """Run work that takes rows; yield the fraction that all devices have taken after each step."""
        for _ in work:
            yield 1 - self.left / self._count

    def stop(self) -> None:
        """Drop the rows that are left, so that all devices stop, at the latest after their slice."""
        with self._lock:
            self.stopped, self._first = True, self._last
