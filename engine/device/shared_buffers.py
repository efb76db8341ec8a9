"""Cache of uploaded buffers by array; a buffer lives as long as its array."""

from __future__ import annotations

import weakref
from collections.abc import Callable

import numpy as np

from .opencl import cl


class SharedBuffers:
    """Cache of device buffers by source array; the arrays must not change afterwards."""

    def __init__(self) -> None:
        self._made: dict[tuple[int, str], cl.Buffer] = {}

    def get(self, array: np.ndarray, form: str) -> cl.Buffer | None:
        """Return the buffer of an array in one of its device layouts, None if there is none."""
        return self._made.get((id(array), form))

    def of(self, array: np.ndarray, form: str, make: Callable[[], cl.Buffer]) -> cl.Buffer:
        """Return the buffer of an array in one of its device layouts, created on first use.

        array:  source array
        form:   name of the layout
        make:   creates the buffer
        """
        key = id(array), form
        if key not in self._made:
            self._made[key] = make()
            weakref.finalize(array, self._made.pop, key, None).atexit = False
        return self._made[key]
