"""When a bake writes what it has found, so that writing takes little of its time."""

from __future__ import annotations

import time

#: Writing takes at most this part of a bake's time.
_PART = 0.1

#: Bytes that a disk writes in a second before it is known, and the least that are written at once.
_RATE, _LEAST = 200e6, 1 << 24


class WriteThrottle:
    """Tells when to write, and how much.

    interval  seconds between two times, and before the first
    """

    def __init__(self, interval: float) -> None:
        self._interval, self._rate = interval, _RATE
        self._begun = self._last = time.monotonic()
        self._spent = 0.0

    @property
    def due(self) -> bool:
        """True if it is time to write."""
        now = time.monotonic()
        return now - self._last >= self._interval and self._spent <= _PART * (now - self._begun)

    @property
    def room(self) -> int:
        """Bytes that may be written now."""
        seconds = _PART * (time.monotonic() - self._begun) - self._spent
        return max(_LEAST, int(self._rate * seconds))

    def wrote(self, size: int, began: float) -> None:
        """Note that bytes were written from a time on, as of `time.monotonic`."""
        self._last = time.monotonic()
        seconds = self._last - began
        self._spent += seconds
        if size >= _LEAST:
            self._rate = size / max(seconds, 1e-9)
