"""Checkpoint of a bake: computed visibility samples, state of the solver, and finished light probes."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property

import numpy as np

from .array_file import read_arrays
from .checkpoint_folder import CheckpointFolder

#: Pattern of file names with visibility rows: sampler, first patch, patch after the last.
_ROWS = re.compile(r"([a-z]+)-(\d+)-(\d+)")

Arrays = Mapping[str, np.ndarray]

#: File of the solver state, and the array in it with the key of its inputs.
_LIGHT, _KEY = "light", "key"

#: Pattern of file names with light probes: number of the file.
_PROBES = re.compile(r"probes-(\d+)")

#: Maximum fraction of a bake's time that writing may take.
_PART = 0.1

#: Initial estimate of the disk's rate, bytes per second, and minimum number of bytes per write.
_RATE, _LEAST = 200e6, 1 << 24


class Checkpoints:
    """Checkpoints that a bake writes, and checkpoints of interrupted bakes from which it resumes.

    cache_dir, limit:  see `CheckpointFolder`
    interval:          seconds between two writes, and before the first
    resumed:           sentences for the report: restored data
    """

    def __init__(self, cache_dir: str | None = None, limit: int = 0, interval: float = 0) -> None:
        self.folder, self.time = CheckpointFolder(cache_dir, limit), WriteThrottle(interval)
        self.resumed: list[str] = []
        self._used: list[Checkpoint] = []

    def of(self, key: Callable[[], str]) -> Checkpoint:
        """Return the checkpoint of the bake with this key; the digest of the key is computed on first use."""
        self._used.append(Checkpoint(self, key))
        return self._used[-1]

    def keys(self) -> set[str]:
        """Return the keys of the checkpoints that this bake wrote or may have found."""
        return {checkpoint.key for checkpoint in self._used if checkpoint.begun}

    def finish(self) -> None:
        """Remove the checkpoints of a completed bake."""
        for checkpoint in self._used:
            checkpoint.remove()


class Checkpoint:
    """Checkpoint of the patches of one key.

    Rows are visibility samples of patches, by name of the `VisibilitySampler`. A file that is damaged, or
    cannot be read or written, counts as missing.
    """

    def __init__(self, shared: Checkpoints, key: Callable[[], str]) -> None:
        self._shared, self._make_key = shared, key
        self._looks = not shared.folder.empty
        self._wrote = False

    @cached_property
    def key(self) -> str:
        """Digest of everything that determines the stored rows."""
        return self._make_key()

    @property
    def keeps(self) -> bool:
        """True if checkpoints are stored."""
        return self._shared.folder.keeps

    @property
    def due(self) -> bool:
        """True if the interval between two writes has passed."""
        return self.keeps and self._shared.time.due

    @property
    def begun(self) -> bool:
        """True if a checkpoint was written or found."""
        return self._looks or self._wrote

    @property
    def room(self) -> int:
        """Maximum number of bytes that one write may take now."""
        return self._shared.time.room

    def rows_from_the_first(self, sampler: str) -> int:
        """Return the number of consecutive patches, from the first on, for which rows are stored."""
        runs = [(first, last) for name, first, last in self._rows() if name == sampler]
        end = 0
        for first, last in sorted(runs):
            end = max(end, last) if first <= end else end
        return end

    def rows(self, sampler: str, first: int, end: int) -> tuple[int, Arrays] | None:
        """Return the longest run of rows that starts at `first` and ends by `end`, as (end of run, arrays).

        None if no run starts there.
        """
        lasts = [last for name, begin, last in self._rows() if (name, begin) == (sampler, first)]
        for last in sorted((last for last in lasts if first < last <= end), reverse=True):
            arrays = self._read(_rows_name(sampler, first, last))
            if arrays is not None:
                return last, arrays
        return None

    def write_rows(self, sampler: str, first: int, last: int, arrays: Arrays) -> bool:
        """Store the rows of the patches first <= i < last; return True if they were written."""
        return self._write(_rows_name(sampler, first, last), arrays)

    def light(self, key: Callable[[], str]) -> Arrays | None:
        """Return the solver state stored under a key; None if there is none."""
        return self._read_keyed(_LIGHT, key) if self._looks else None

    def write_light(self, key: Callable[[], str], arrays: Arrays) -> None:
        """Store the solver state under a key, replacing any earlier state."""
        self._write_keyed(_LIGHT, key, arrays)

    def probes(self, key: Callable[[], str]) -> Iterator[tuple[int, Arrays]]:
        """Return the number and the arrays of each file of light probes stored under a key."""
        names = [path.name for path in self._shared.folder.files(self.key)] if self._looks else []
        for match in filter(None, map(_PROBES.fullmatch, names)):
            arrays = self._read_keyed(match[0], key)
            if arrays is not None:
                yield int(match[1]), arrays

    def write_probes(self, key: Callable[[], str], number: int, arrays: Arrays) -> bool:
        """Store a numbered file of light probes under a key; return True if it was written."""
        return self._write_keyed(f"probes-{number}", key, arrays)

    def note(self, sentence: str) -> None:
        """Add a sentence about restored data to the report."""
        self._shared.resumed.append(sentence)

    def remove(self) -> None:
        """Remove the checkpoint."""
        if self.begun:
            self._shared.folder.remove(self.key)

    def _rows(self) -> list[tuple[str, int, int]]:
        """Return the sampler, first patch and end patch of each file of rows, read from the file names."""
        if not self._looks:
            return []
        names = (_ROWS.fullmatch(path.name) for path in self._shared.folder.files(self.key))
        return [(name[1], int(name[2]), int(name[3])) for name in names if name]

    def _read_keyed(self, name: str, key: Callable[[], str]) -> Arrays | None:
        """Return the arrays of a file; None if it is missing or has another key."""
        arrays = self._read(name)
        return arrays if arrays is not None and bytes(arrays[_KEY]).decode() == key() else None

    def _write_keyed(self, name: str, key: Callable[[], str], arrays: Arrays) -> bool:
        """Write a file with the key of its inputs."""
        return self._write(name, {_KEY: np.frombuffer(key().encode(), np.uint8), **arrays})

    def _read(self, name: str) -> Arrays | None:
        return next(
            (read_arrays(path) for path in self._shared.folder.files(self.key) if path.name == name), None
        )

    def _write(self, name: str, arrays: Arrays) -> bool:
        began = time.monotonic()
        written = self._shared.folder.write(self.key, name, arrays, self._shared.keys())
        self._shared.time.wrote(sum(array.nbytes for array in arrays.values()), began)
        self._wrote = self._wrote or written
        return written


def _rows_name(sampler: str, first: int, last: int) -> str:
    return f"{sampler}-{first}-{last}"


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
