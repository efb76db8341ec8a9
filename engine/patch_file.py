"""Stores a patch list in a binary file and loads it again (paper, IV.A).

Layout, little-endian: magic, version, resolution, number of patches, CRC-32 of the body; then the
body: atlas, texel, mesh, face, subface (int32 each) and barycentric (3 float32), array after array.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np

from .errors import PatchFileError
from .patches import PatchList

_MAGIC = b"HEMIPATC"
_VERSION = 1
_HEADER = struct.Struct("<8sIIQI")
_INTEGERS = ("atlas", "texel", "mesh", "face", "subface")
_PATCH_BYTES = 4 * (len(_INTEGERS) + 3)


def write_patches(path: Path, patches: PatchList) -> None:
    """Write a patch list to a file."""
    body = b"".join(getattr(patches, name).astype("<i4").tobytes() for name in _INTEGERS)
    body += patches.barycentric.astype("<f4").tobytes()
    header = _HEADER.pack(_MAGIC, _VERSION, patches.resolution, len(patches), zlib.crc32(body))
    path.write_bytes(header + body)


def read_patches(path: Path) -> PatchList:
    """Read a patch list from a file.

    Raises PatchFileError if the file is not a patch file, of another version, truncated or damaged.
    """
    data = path.read_bytes()
    if data[:8] != _MAGIC:
        raise PatchFileError(f"'{path}' is not a Hemibake patch file. Choose another file or bake again.")
    if len(data) < _HEADER.size:
        raise PatchFileError(f"'{path}' ends within its header. Export the patch list again.")
    _, version, resolution, count, checksum = _HEADER.unpack_from(data)
    body = data[_HEADER.size :]
    if version != _VERSION:
        raise PatchFileError(
            f"'{path}' has version {version}, this Hemibake reads version {_VERSION}. "
            "Export the patch list again."
        )
    if len(body) != count * _PATCH_BYTES:
        raise PatchFileError(
            f"'{path}' should hold {count} patches in {count * _PATCH_BYTES} bytes but has {len(body)}. "
            "It is truncated or damaged; export the patch list again."
        )
    if zlib.crc32(body) != checksum:
        raise PatchFileError(f"'{path}' is damaged: its checksum is wrong. Export the patch list again.")
    return _unpack(body, resolution, count)


def _unpack(body: bytes, resolution: int, count: int) -> PatchList:
    integers = np.frombuffer(body, "<i4", 5 * count).astype(np.int32).reshape(5, count)
    barycentric = np.frombuffer(body, "<f4", 3 * count, 20 * count).astype(np.float32).reshape(count, 3)
    columns = {name: row.copy() for name, row in zip(_INTEGERS, integers, strict=True)}
    return PatchList(resolution, barycentric=barycentric, **columns)
