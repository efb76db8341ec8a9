"""Work on many items in slices, whose size a controller adapts to the device."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from dataclasses import dataclass

from .opencl import cl

#: A shorter slice is mostly launch latency, so that size grows whatever the throughput does, s. Chosen.
_SHORT = 0.02

#: A slice that takes longer is not doubled: twice its time must pass before a cancel is noticed, s. Chosen.
_DOUBLED = 0.25

#: Throughput of a larger slice over the throughput of a smaller one that makes it worth its latency. Chosen.
_GAIN = 1.1

#: A slice of half the items that takes more than this part of the time gains no latency. Chosen.
_SAME = 0.9

#: Full slices until a size that was rejected is tried again, since costs of items vary. Chosen.
_REST = 16

#: Part of the longest time that the next slice remembers: one spike is forgotten after ten slices. Chosen.
_FADE = 0.8

#: Throughput of half a slice over the throughput of a slice too long that shows an interruption. Chosen.
_INTERRUPTED = 2.0

#: Largest growth of very short slices. Chosen.
_LEAP = 8


@dataclass(frozen=True)
class SliceLimits:
    """Bounds of the size of slices.

    first    items of the first slice
    least    fewest items of a slice, unless fewer are left
    fill     items below which a device is partly idle
    longest  time of a slice, s
    """

    first: int
    least: int
    fill: int
    longest: float


@dataclass(frozen=True)
class _Slice:
    """A slice that was run: its items, and its time in s."""

    items: int
    seconds: float

    @property
    def throughput(self) -> float:
        """Items per second."""
        return self.items / max(self.seconds, 1e-9)


class TimeSlicer:
    """A controller of the number of items in a slice, driven by items per second.

    It doubles the size while that raises the throughput by a tenth, and halves it above the longest time.
    Below `SliceLimits.fill` it doubles in any case: a device that is partly idle takes the same time for more
    items. A size that brought nothing is left again, and tried again some slices later.
    """

    def __init__(self, limits: SliceLimits) -> None:
        self._limits, self._items = limits, limits.first
        self._allowed = limits.longest
        self._before: _Slice | None = None
        self._longest, self._rest = 0.0, 0

    def run(self, first: int, last: int, work: Callable[[int, int], object]) -> Generator[int, None, None]:
        """Call work(start, end) for slices of first ... last; yield the end of each.

        work  returns when its slice is done
        """
        start, self._allowed = first, self._limits.longest
        while start < last:
            end, began = min(start + self._items, last), time.perf_counter()
            work(start, end)
            self._adapt(_Slice(end - start, time.perf_counter() - began))
            start = end
            yield end

    def _adapt(self, done: _Slice) -> None:
        """Choose the size of the next slice; one that was cut short only tells that items take too long."""
        allowed = self._longest_allowed(done.items)
        if done.items < self._items and done.seconds <= allowed:
            return
        before, self._before = self._before, None
        self._longest, self._rest = max(done.seconds, _FADE * self._longest), max(self._rest - 1, 0)
        if before and before.items > done.items and self._undoes(before, done):
            self._items, self._longest, self._rest = before.items, done.seconds, 0
        elif done.seconds > allowed:
            self._halve(done)
        elif before and before.items < done.items and not self._pays(before, done):
            self._items, self._rest = before.items, _REST
        elif self._may_grow(done.items):
            self._grow(done)

    def _longest_allowed(self, items: int) -> float:
        """Return the longest time of a slice of so many items, s; it is raised for a partly idle device."""
        return self._allowed if items < self._limits.fill else self._limits.longest

    def _undoes(self, before: _Slice, done: _Slice) -> bool:
        """Return True if a slice of half the items shows that the whole one was not too large.

        Either something else delayed the whole one, or the device is partly idle and takes as long for half.
        """
        if before.items < self._limits.fill and done.seconds > _SAME * before.seconds:
            self._allowed = max(done.seconds, before.seconds) / _SAME
            return True
        return done.throughput > _INTERRUPTED * before.throughput

    def _pays(self, before: _Slice, done: _Slice) -> bool:
        """Return True if a larger slice is to stay."""
        short = done.items <= self._limits.fill or before.seconds < _SHORT
        return short or done.throughput > _GAIN * before.throughput

    def _may_grow(self, items: int) -> bool:
        """Return True if the next slice may have twice the items, by the longest time of late."""
        if self._longest < _SHORT:
            return True
        latency = items < self._limits.fill and self._allowed > self._limits.longest
        return not self._rest and (latency or self._longest <= min(_DOUBLED, self._limits.longest))

    def _grow(self, done: _Slice) -> None:
        """Double the size, more than once if a time that grows alike stays within the limits.

        A full device takes longer for more items, a partly idle one need not.
        """
        full, factor = done.items >= self._limits.fill, 2
        within = _SHORT if full else self._limits.longest / 2
        while factor < _LEAP and self._longest * factor < within and (full or self._is_idle(done, factor)):
            factor *= 2
        self._before, self._items = done, done.items * factor
        self._longest *= factor if full else 0

    def _is_idle(self, done: _Slice, factor: int) -> bool:
        """Return True if a slice of `factor` times the items does not fill the device either."""
        return done.items * factor < self._limits.fill

    def _halve(self, done: _Slice) -> None:
        self._before, self._rest = done, _REST
        self._items, self._longest = max(done.items // 2, self._limits.least), self._longest / 2


def sliced(
    queue: cl.CommandQueue,
    first: int,
    last: int,
    launch: Callable[[int, int], object],
    size: TimeSlicer,
) -> Generator[int, None, None]:
    """Call launch(start, end) for slices of first ... last; yield the end of each once it is done.

    size: of slices of the same work before
    """

    def work(start: int, end: int) -> None:
        launch(start, end)
        queue.finish()

    return size.run(first, last, work)
