"""Time slicing: work in slices whose size a controller adapts to the device."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from dataclasses import dataclass

from .opencl import cl
from .row_range import RowRange

#: Seconds below which a slice is mostly launch latency, so that the size grows regardless of throughput.
#: Chosen.
_SHORT = 0.02

#: Seconds above which a slice is not doubled, since a cancel would wait for twice the time. Chosen.
_DOUBLED = 0.25

#: Minimum ratio of throughputs that justifies a larger slice with its latency. Chosen.
_GAIN = 1.1

#: Fraction of a slice's time. If half of its items take longer, smaller slices save no time. Chosen.
_SAME = 0.9

#: Full slices until a rejected size is tried again, since costs vary. Chosen.
_REST = 16

#: Decay of the remembered maximum time at each slice; a spike is forgotten after ten slices. Chosen.
_FADE = 0.8

#: A slow slice counts as interrupted if half of its items have this multiple of its throughput. Chosen.
_INTERRUPTED = 2.0

#: Maximum growth factor of very short slices. Chosen.
_LEAP = 8


@dataclass(frozen=True)
class SliceLimits:
    """Bounds of slice sizes.

    first:    items of the first slice
    least:    minimum items of a slice, except the last
    fill:     items below which the device is partly idle
    longest:  maximum time of a slice, s
    """

    first: int
    least: int
    fill: int
    longest: float


@dataclass(frozen=True)
class _Slice:
    """Completed slice: items and time, s."""

    items: int
    seconds: float

    @property
    def throughput(self) -> float:
        """Items per second."""
        return self.items / max(self.seconds, 1e-9)


class TimeSlicer:
    """Controller of the number of items in a slice, driven by throughput.

    It doubles the size while the throughput rises by a tenth, and halves it above the maximum time. Below
    `SliceLimits.fill` it always doubles, since a partly idle device takes the same time for more items. A
    size without gain is dropped, and tried again some slices later.
    """

    def __init__(self, limits: SliceLimits) -> None:
        self._limits, self._items = limits, limits.first
        self._allowed = limits.longest
        self._before: _Slice | None = None
        self._longest, self._rest = 0.0, 0

    def run(self, first: int, last: int, work: Callable[[int, int], object]) -> Generator[int, None, None]:
        """Call work(start, end) for slices of first ... last; yield the end of each.

        work:  returns when its slice is complete
        """
        for _, end in self.share(RowRange(first, last), work):
            yield end

    def share(
        self, rows: RowRange, work: Callable[[int, int], object], from_end: bool = False
    ) -> Generator[tuple[int, int], None, None]:
        """Call work(start, end) for slices of rows that other devices take from too; yield each slice.

        from_end:  take slices from the end of the rows
        """
        self._allowed = self._limits.longest
        while (taken := rows.take(self._items, self._limits.fill, from_end)) is not None:
            began = time.perf_counter()
            work(*taken)
            self._adapt(_Slice(taken[1] - taken[0], time.perf_counter() - began))
            yield taken

    def _adapt(self, done: _Slice) -> None:
        """Choose the size of the next slice; a shortened last slice only counts if it is too slow."""
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
        """Return the maximum time of a slice, s; longer if `items` leave the device partly idle."""
        return self._allowed if items < self._limits.fill else self._limits.longest

    def _undoes(self, before: _Slice, done: _Slice) -> bool:
        """Return True if a slice of half the items shows that the full one was not too large.

        Either an interruption delayed the full slice, or the device is partly idle and half takes as long.
        """
        if before.items < self._limits.fill and done.seconds > _SAME * before.seconds:
            self._allowed = max(done.seconds, before.seconds) / _SAME
            return True
        return done.throughput > _INTERRUPTED * before.throughput

    def _pays(self, before: _Slice, done: _Slice) -> bool:
        """Return True if a larger slice pays: higher throughput, or a slice too short to judge."""
        short = done.items <= self._limits.fill or before.seconds < _SHORT
        return short or done.throughput > _GAIN * before.throughput

    def _may_grow(self, items: int) -> bool:
        """Return True if the next slice may double, given recent maximum times."""
        if self._longest < _SHORT:
            return True
        latency = items < self._limits.fill and self._allowed > self._limits.longest
        return not self._rest and (latency or self._longest <= min(_DOUBLED, self._limits.longest))

    def _grow(self, done: _Slice) -> None:
        """Double the size, repeatedly while the expected time stays within the limits.

        A full device takes proportionally longer for more items; a partly idle one need not.
        """
        full, factor = done.items >= self._limits.fill, 2
        within = _SHORT if full else self._limits.longest / 2
        while factor < _LEAP and self._longest * factor < within and (full or self._is_idle(done, factor)):
            factor *= 2
        self._before, self._items = done, done.items * factor
        self._longest *= factor if full else 0

    def _is_idle(self, done: _Slice, factor: int) -> bool:
        """Return True if a slice of `factor` times the items still leaves the device partly idle."""
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
    """Call launch(start, end) for slices of first ... last; yield the end of each after the queue finishes.

    size:  controller from earlier slices of the same work
    """
    for _, end in sliced_rows(queue, RowRange(first, last), launch, size):
        yield end


def sliced_rows(
    queue: cl.CommandQueue,
    rows: RowRange,
    launch: Callable[[int, int], object],
    size: TimeSlicer,
    from_end: bool = False,
) -> Generator[tuple[int, int], None, None]:
    """Call launch(start, end) for slices of rows; yield each slice after the queue finishes.

    Parameters as for `sliced` and `TimeSlicer.share`.
    """

    def work(start: int, end: int) -> None:
        launch(start, end)
        queue.finish()

    return size.share(rows, work, from_end)
