"""Files of named arrays with a checksum; a damaged file counts as missing.

bytes  | checksum of all that follows | length of header | header: JSON       | array 0 | array 1 ...
       '------------- 16 -------------'------- 8 --------'- (name, type, shape) of each array
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import struct
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

_CHECKSUM = 16
_LENGTH = struct.Struct("<Q")


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write arrays to a file atomically: a temporary file is renamed once complete. Raises OSError."""
    values = [np.ascontiguousarray(array) for array in arrays.values()]
    layout = [(name, array.dtype.str, array.shape) for name, array in zip(arrays, values, strict=True)]
    header = json.dumps(layout).encode()
    parts: list[bytes | memoryview] = [
        _LENGTH.pack(len(header)),
        header,
        *(array.reshape(-1).view(np.uint8).data for array in values),
    ]
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with partial.open("wb") as file:
            file.write(_checksum(parts))
            file.writelines(parts)
        partial.replace(path)
    except OSError:
        with suppress(OSError):
            partial.unlink()
        raise


def read_arrays(path: Path) -> dict[str, np.ndarray] | None:
    """Return the arrays of a file, read-only; None if the file is missing or damaged."""
    try:
        content = memoryview(path.read_bytes())
    except OSError:
        return None
    if len(content) < _CHECKSUM + _LENGTH.size or content[:_CHECKSUM] != _checksum([content[_CHECKSUM:]]):
        return None
    (length,) = _LENGTH.unpack_from(content, _CHECKSUM)
    first = _CHECKSUM + _LENGTH.size
    offset, arrays = first + length, {}
    for name, kind, shape in json.loads(bytes(content[first:offset])):
        array = np.frombuffer(content, kind, math.prod(shape), offset).reshape(shape)
        arrays[name], offset = array, offset + array.nbytes
    return arrays


def _checksum(parts: Iterable[bytes | memoryview]) -> bytes:
    """Return the BLAKE2b digest of bytes."""
    digest = hashlib.blake2b(digest_size=_CHECKSUM)
    for part in parts:
        digest.update(part)
    return digest.digest()
