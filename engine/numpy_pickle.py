"""Pickles that other versions of NumPy read: a worker's may be older than that of Blender's Python."""

from __future__ import annotations

import io
import pickle
from typing import Any

import numpy as np

#: Every Python from 3.8 on reads it.
_PROTOCOL = 5


class NumpyPickle:
    """What is pickled with its arrays as bytes, types and shapes, as no version of NumPy has them."""

    def __reduce__(self) -> tuple:
        return _restored, (type(self), portable_bytes(vars(self)))


def portable_bytes(value: Any) -> bytes:
    """Return the pickle of what holds arrays and numbers of NumPy."""
    data = io.BytesIO()
    _Pickler(data, _PROTOCOL).dump(value)
    return data.getvalue()


class _Pickler(pickle.Pickler):
    def reducer_override(self, value: Any) -> Any:
        """Reduce arrays and numbers of NumPy; everything else reduces itself."""
        if not isinstance(value, np.ndarray | np.generic) or value.dtype.hasobject:
            return NotImplemented
        kind = value.dtype.descr if value.dtype.names else value.dtype.str
        array = _array, (value.tobytes(), kind, value.shape)
        return array if isinstance(value, np.ndarray) else (_number, array[1])


def _restored(kind: type, data: bytes) -> Any:
    """Return an object as it was before `NumpyPickle` reduced it."""
    made: Any = object.__new__(kind)
    vars(made).update(pickle.loads(data))
    return made


def _array(data: bytes, kind: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return an array of its bytes, row by row; it may be written to."""
    return np.frombuffer(bytearray(data), np.dtype(kind)).reshape(shape)


def _number(data: bytes, kind: Any, shape: tuple[int, ...]) -> Any:
    return _array(data, kind, shape)[()]
