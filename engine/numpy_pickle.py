"""Pickles that are independent of the NumPy version, since workers may have another one than Blender."""

from __future__ import annotations

import io
import pickle
from typing import Any

import numpy as np

#: Readable by Python 3.8 and later.
_PROTOCOL = 5


class NumpyPickle:
    """Base class of objects whose arrays are pickled as bytes, dtype and shape."""

    def __reduce__(self) -> tuple:
        return _restored, (type(self), portable_bytes(vars(self)))


def portable_bytes(value: Any) -> bytes:
    """Return the pickle of an object that may contain NumPy arrays and scalars."""
    data = io.BytesIO()
    _Pickler(data, _PROTOCOL).dump(value)
    return data.getvalue()


class _Pickler(pickle.Pickler):
    def reducer_override(self, value: Any) -> Any:
        """Reduce NumPy arrays and scalars; leave all other objects to the default."""
        if not isinstance(value, np.ndarray | np.generic) or value.dtype.hasobject:
            return NotImplemented
        kind = value.dtype.descr if value.dtype.names else value.dtype.str
        array = _array, (value.tobytes(), kind, value.shape)
        return array if isinstance(value, np.ndarray) else (_number, array[1])


def _restored(kind: type, data: bytes) -> Any:
    """Rebuild an object that `NumpyPickle` has reduced to its class and fields."""
    made: Any = object.__new__(kind)
    vars(made).update(pickle.loads(data))
    return made


def _array(data: bytes, kind: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return a writable array from its bytes in C order."""
    return np.frombuffer(bytearray(data), np.dtype(kind)).reshape(shape)


def _number(data: bytes, kind: Any, shape: tuple[int, ...]) -> Any:
    return _array(data, kind, shape)[()]
