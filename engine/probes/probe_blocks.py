"""Finished blocks of light probes in the checkpoint of a bake."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import cache

import numpy as np

from ..resume.checkpoint import Checkpoint

#: Values of n probes: coefficients, (n, lights, 9, 3) float32, validity, (n,) float32, positions, (n, 3)
#: float64, m, and distances, see `ProbeRows`.
ProbePart = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]

#: Names of these values in files.
_VALUES = ("coefficients", "validity", "positions", "distances")


class ProbeBlocks:
    """Finished blocks of consecutive probes, restored from an interrupted bake or gathered by this bake.

    Whenever a checkpoint is due, new blocks are written until its time limit.
    """

    def __init__(self, checkpoint: Checkpoint, key: Callable[[], str]) -> None:
        """Read the blocks of an interrupted bake.

        key:  returns a digest of everything that determines the light of the probes
        """
        self._checkpoint, self._key = checkpoint, cache(key)
        self._new = dict[str, ProbePart]()
        self._known, self._files = dict[str, np.ndarray](), set[int]()
        for number, arrays in checkpoint.probes(self._key):
            self._known |= arrays
            self._files.add(number)
        count = sum(len(array) for name, array in self._known.items() if name.endswith(_VALUES[1]))
        if count:
            checkpoint.note(f"{count:,} light probes were restored from an interrupted bake.")

    def find(self, volume: int, first: int, end: int) -> ProbePart | None:
        """Return the values of the probes first <= i < end, read-only; None unless they are stored."""
        block = _name(volume, first, end)
        coefficients, validity, positions, distances = (
            self._known.get(f"{block} {value}") for value in _VALUES
        )
        if coefficients is None or validity is None or positions is None or distances is None:
            return None
        return coefficients, validity, positions, distances

    def add(self, volume: int, first: int, end: int, part: ProbePart) -> None:
        """Store the values of the probes first <= i < end, now or when a checkpoint is due."""
        if self._checkpoint.keeps:
            self._new[_name(volume, first, end)] = part
        if self._checkpoint.due:
            self._write()

    def _write(self) -> None:
        """Write new blocks, at least one; forget them if there is no space.

        The file gets the first number that no file of this light has, so damaged files and files of other
        light are replaced.
        """
        arrays, room = dict[str, np.ndarray](), self._checkpoint.room
        for block in list(self._new):
            if arrays and sum(array.nbytes for array in arrays.values()) > room:
                break
            values = zip(_VALUES, self._new.pop(block), strict=True)
            arrays |= {f"{block} {name}": array for name, array in values}
        number = next(number for number in itertools.count() if number not in self._files)
        if self._checkpoint.write_probes(self._key, number, arrays):
            self._files.add(number)


def _name(volume: int, first: int, end: int) -> str:
    return f"{volume} {first} {end}"
