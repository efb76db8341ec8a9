"""The checkpoint of a bake: what its patches see, as far as it is found, and how far the light has come."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping
from functools import cached_property

import numpy as np

from .array_file import read_arrays
from .checkpoint_folder import CheckpointFolder
from .write_throttle import WriteThrottle

#: Names of files of rows: that of an identity, the first patch, and the one after the last.
_ROWS = re.compile(r"([a-z]+)-(\d+)-(\d+)")

Arrays = Mapping[str, np.ndarray]

#: The file of the light, and the array in it that says whose light it is.
_LIGHT, _KEY = "light", "key"


class Checkpoints:
    """The checkpoints that a bake writes, and those of interrupted ones that it goes on from.

    cache_dir, limit  see `CheckpointFolder`
    interval          seconds between two times of writing, and before the first
    resumed           sentences for the report: what the bake went on from
    """

    def __init__(self, cache_dir: str | None = None, limit: int = 0, interval: float = 0) -> None:
        self.folder, self.time = CheckpointFolder(cache_dir, limit), WriteThrottle(interval)
        self.resumed: list[str] = []
        self._used: list[Checkpoint] = []

    def of(self, key: Callable[[], str]) -> Checkpoint:
        """Return the checkpoint of what has a key: a digest, made once it is needed."""
        self._used.append(Checkpoint(self, key))
        return self._used[-1]

    def finish(self) -> None:
        """Remove what a bake has written that is done."""
        for checkpoint in self._used:
            checkpoint.remove()


class Checkpoint:
    """What is known of the patches of one key.

    Rows are samples of what patches see, as a `VisibilitySampler` of a name finds them. A file that is
    damaged, or cannot be read or written, is as good as none.
    """

    def __init__(self, shared: Checkpoints, key: Callable[[], str]) -> None:
        self._shared, self._make_key = shared, key
        self._looks = not shared.folder.empty
        self._wrote = False

    @cached_property
    def _key(self) -> str:
        return self._make_key()

    @property
    def due(self) -> bool:
        """True if it is time to write."""
        return self._shared.folder.keeps and self._shared.time.due

    @property
    def begun(self) -> bool:
        """True if something was written, or read."""
        return self._looks or self._wrote

    @property
    def room(self) -> int:
        """Bytes that may be written now; see `WriteThrottle.room`."""
        return self._shared.time.room

    def rows_from_the_first(self, identity: str) -> int:
        """Return of how many patches in a row, from the first one on, rows seem to be kept."""
        runs = [(first, last) for name, first, last in self._rows() if name == identity]
        end = 0
        for first, last in sorted(runs):
            end = max(end, last) if first <= end else end
        return end

    def rows(self, identity: str, first: int, end: int) -> tuple[int, Arrays] | None:
        """Return the longest run of rows of the patches first ... end, and before it the patch after it.

        None if no run begins with the first patch.
        """
        lasts = [last for name, begin, last in self._rows() if (name, begin) == (identity, first)]
        for last in sorted((last for last in lasts if first < last <= end), reverse=True):
            arrays = self._read(_rows_name(identity, first, last))
            if arrays is not None:
                return last, arrays
        return None

    def write_rows(self, identity: str, first: int, last: int, arrays: Arrays) -> bool:
        """Keep the rows of the patches first ... last; return whether that was possible."""
        return self._write(_rows_name(identity, first, last), arrays)

    def light(self, key: Callable[[], str]) -> Arrays | None:
        """Return the light that was kept under a key, None if there is none."""
        arrays = self._read(_LIGHT) if self._looks else None
        return arrays if arrays is not None and bytes(arrays[_KEY]).decode() == key() else None

    def write_light(self, key: Callable[[], str], arrays: Arrays) -> None:
        """Keep light under a key, in place of what was kept before."""
        self._write(_LIGHT, {_KEY: np.frombuffer(key().encode(), np.uint8), **arrays})

    def tell(self, sentence: str) -> None:
        """Add a sentence to the report."""
        self._shared.resumed.append(sentence)

    def remove(self) -> None:
        """Remove it."""
        if self.begun:
            self._shared.folder.remove(self._key)

    def _rows(self) -> list[tuple[str, int, int]]:
        """Return identities, first patches and the ones after the last of all rows."""
        if not self._looks:
            return []
        names = (_ROWS.fullmatch(path.name) for path in self._shared.folder.files(self._key))
        return [(name[1], int(name[2]), int(name[3])) for name in names if name]

    def _read(self, name: str) -> Arrays | None:
        return next(
            (read_arrays(path) for path in self._shared.folder.files(self._key) if path.name == name), None
        )

    def _write(self, name: str, arrays: Arrays) -> bool:
        began = time.monotonic()
        written = self._shared.folder.write(self._key, name, arrays)
        self._shared.time.wrote(sum(array.nbytes for array in arrays.values()), began)
        self._wrote = self._wrote or written
        return written


def _rows_name(identity: str, first: int, last: int) -> str:
    return f"{identity}-{first}-{last}"
