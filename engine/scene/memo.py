"""Memoization of the last result of a computation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np

from .digests import same_values

Result = TypeVar("Result")


class Memo(Generic[Result]):
    """Last result of a computation, reused while its inputs have the same values.

    max_bytes:  total size of input arrays above which the result is not stored; None for no limit
    """

    def __init__(self, max_bytes: int | None = None) -> None:
        self._max_bytes, self._last = max_bytes, list[tuple[tuple, Result]]()

    def clear(self) -> None:
        """Drop the result."""
        self._last = []

    def get(self, inputs: tuple, make: Callable[[], Result]) -> Result:
        """Return the stored result if `inputs` are unchanged, else the result of `make`."""
        if self._last and same_values(inputs, self._last[0][0]):
            return self._last[0][1]
        result = make()
        size = sum(value.nbytes for value in inputs if isinstance(value, np.ndarray))
        self._last = [(inputs, result)] if self._max_bytes is None or size <= self._max_bytes else []
        return result
