"""Throttle of checkpoint writes, so that they take little of a bake's time."""

from __future__ import annotations

import time

#: Maximum fraction of a bake's time that writing may take.
_PART = 0.1

#: Initial estimate of the disk's rate, bytes per second, and minimum number of bytes per write.
_RATE, _LEAST = 200e6, 1 << 24


class WriteThrottle:
    """Throttle of checkpoint writes by time and size.

    interval:  seconds between two writes, and before the first
    """

    def __init__(self, interval: float) -> None:
        self._interval, self._rate = interval, _RATE
        self._begun = self._last = time.monotonic()
        self._spent = 0.0

    @property
    def due(self) -> bool:
        """True if the interval since the last write has passed."""
        now = time.monotonic()
        return now - self._last >= self._interval and self._spent <= _PART * (now - self._begun)

    @property
    def room(self) -> int:
        """Maximum number of bytes to write now, so that writing stays within its share of time."""
        seconds = _PART * (time.monotonic() - self._begun) - self._spent
        return max(_LEAST, int(self._rate * seconds))

    def wrote(self, size: int, began: float) -> None:
        """Record a write of `size` bytes that started at `began`, as from `time.monotonic`."""
        self._last = time.monotonic()
        seconds = self._last - began
        self._spent += seconds
        if size >= _LEAST:
            self._rate = size / max(seconds, 1e-9)
