"""Page-locked staging memory for copies to and from a GPU."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from threading import RLock

import numpy as np

from .opencl import cl

#: Number of page-locked chunks and size of each, bytes; one is filled while the others are transferred.
_CHUNKS, _CHUNK = 4, 1 << 22

#: Number of chunks that are read ahead; the others may be on the way to another device.
_AHEAD = 2


class Staging:
    """Copies between arrays and buffers by way of page-locked chunks.

        array --host--> | chunk | chunk | chunk | chunk | --card, meanwhile--> buffer

    From other memory, a driver copies into page-locked chunks of its own, and the host waits for each copy.

    Threads take turns.

    queue:  in order
    """

    def __init__(self, queue: cl.CommandQueue) -> None:
        self._queue = queue
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.ALLOC_HOST_PTR
        access = cl.map_flags.READ | cl.map_flags.WRITE
        self._locked = [cl.Buffer(queue.context, flags, _CHUNK) for _ in range(_CHUNKS)]
        self._chunks = [
            cl.enqueue_map_buffer(queue, locked, access, 0, (_CHUNK,), np.uint8)[0] for locked in self._locked
        ]
        self._copies: list[list[cl.Event]] = [[] for _ in range(_CHUNKS)]
        self._next, self._turn = 0, RLock()

    def fill(
        self, buffer: cl.Buffer, size: int, store: Callable[[np.ndarray, int], object], at: int = 0
    ) -> None:
        """Write `size` bytes into a buffer from byte `at` on.

        store:  stores bytes from an offset on in a page-locked chunk, (k,) uint8
        """
        with self._turn:
            for first in range(0, size, _CHUNK):
                slot = self._free()
                chunk = self._chunks[slot][: min(_CHUNK, size - first)]
                store(chunk, first)
                self._copies[slot] = [self._enqueue_write(buffer, chunk, at + first)]
            self._queue.flush()

    def write(self, buffer: cl.Buffer, values: np.ndarray, at: int = 0) -> None:
        """Write a contiguous array into a buffer from byte `at` on.

        The array may change after the call returns.
        """
        source = values.reshape(-1).view(np.uint8)

        def store(chunk: np.ndarray, first: int) -> None:
            chunk[:] = source[first : first + len(chunk)]

        self.fill(buffer, len(source), store, at)

    def read(self, buffer: cl.Buffer, values: np.ndarray, first: int = 0) -> None:
        """Read a buffer from byte `first` into a contiguous array; waits for all earlier commands."""
        target = values.reshape(-1).view(np.uint8)
        with self._turn:
            for _, start, chunk in self._arriving(buffer, len(target), first):
                target[start : start + len(chunk)] = chunk

    def send(
        self, buffer: cl.Buffer, size: int, targets: Sequence[tuple[Staging, cl.Buffer]], first: int = 0
    ) -> None:
        """Copy bytes of a buffer, from byte `first` on, to the same place of buffers of other devices.

        Waits for all earlier commands of this device. The other queues may not have ended on return. All GPUs
        of a driver read the page-locked chunks of this device at full speed.
        """
        with self._turn:
            for slot, start, chunk in self._arriving(buffer, size, first):
                for staging, target in targets:
                    self._copies[slot].append(staging._enqueue_write(target, chunk, first + start))
                    staging._queue.flush()

    def _enqueue_write(self, buffer: cl.Buffer, chunk: np.ndarray, at: int) -> cl.Event:
        """Enqueue a copy of a page-locked chunk into a buffer from byte `at` on."""
        return cl.enqueue_copy(self._queue, buffer, chunk, dst_offset=at, is_blocking=False)

    def _arriving(self, buffer: cl.Buffer, size: int, first: int) -> Iterator[tuple[int, int, np.ndarray]]:
        """Yield slot, offset and contents of each chunk of a buffer; contents change after the next one.

        They stay until copies that the caller adds to `_copies` have ended.
        """
        waiting: list[tuple[int, int]] = []

        def oldest() -> tuple[int, int, np.ndarray]:
            slot, start = waiting.pop(0)
            self._wait(slot)
            return slot, start, self._chunks[slot][: min(_CHUNK, size - start)]

        for start in range(0, size, _CHUNK):
            if len(waiting) == _AHEAD:
                yield oldest()
            slot = self._free()
            chunk = self._chunks[slot][: min(_CHUNK, size - start)]
            copy = cl.enqueue_copy(self._queue, chunk, buffer, src_offset=first + start, is_blocking=False)
            self._copies[slot] = [copy]
            waiting.append((slot, start))
        while waiting:
            yield oldest()

    def _free(self) -> int:
        """Return the least recently used chunk once its copies have ended."""
        slot, self._next = self._next, (self._next + 1) % _CHUNKS
        self._wait(slot)
        return slot

    def _wait(self, slot: int) -> None:
        copies, self._copies[slot] = self._copies[slot], []
        for copy in copies:
            copy.wait()
