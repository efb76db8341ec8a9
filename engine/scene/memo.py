"""Memoization of the last results of a computation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np

from .digests import same_values

Result = TypeVar("Result")


class Memo(Generic[Result]):
    """Last results of a computation, reused while its inputs have the same values.

    max_bytes:  total size of input arrays above which a result is not stored; None for no limit
    results:    number of results that are stored
    """

    def __init__(self, max_bytes: int | None = None, results: int = 1) -> None:
        self._max_bytes, self._results = max_bytes, results
        self._last = list[tuple[tuple, Result]]()

    def clear(self) -> None:
        """Drop all results."""
        self._last = []

    def get(self, inputs: tuple, make: Callable[[], Result]) -> Result:
        """Return the stored result of the same `inputs`, else the result of `make`."""
        for known, result in self._last:
            if same_values(inputs, known):
                return result
        result = make()
        size = sum(value.nbytes for value in inputs if isinstance(value, np.ndarray))
        is_stored = self._max_bytes is None or size <= self._max_bytes
        self._last = [(inputs, result), *self._last][: self._results] if is_stored else []
        return result
