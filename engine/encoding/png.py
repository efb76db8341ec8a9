"""PNG encoder (ISO/IEC 15948)."""

from __future__ import annotations

import struct
import zlib

import numpy as np

_SIGNATURE = b"\x89PNG\r\n\x1a\n"

#: Color types of the PNG header: 2 for three channels, 6 for four channels with alpha.
_COLOUR_TYPE = {3: 2, 4: 6}

#: Filter type that stores each byte as its difference from the pixel to the left.
_SUB = 1


def png_bytes(texels: np.ndarray, srgb: bool) -> bytes:
    """Return a PNG file of texels, (h, w, 3 or 4) uint8 or uint16, bottom row first.

    srgb: True to mark the colours as sRGB; otherwise the file has no colour space
    """
    height, width, channels = texels.shape
    bits = 8 * texels.itemsize
    header = struct.pack(">IIBBBBB", width, height, bits, _COLOUR_TYPE[channels], 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(_filtered(_bytes(texels[::-1])))), (b"IEND", b"")]
    if srgb:
        chunks.insert(1, (b"sRGB", b"\0"))
    return _SIGNATURE + b"".join(_chunk(*chunk) for chunk in chunks)


def _bytes(texels: np.ndarray) -> np.ndarray:
    """Return texels, (h, w, channels) uint8 or uint16, as (h, w, bytes) uint8 in big-endian order."""
    return np.ascontiguousarray(texels, texels.dtype.newbyteorder(">")).view(np.uint8)


def _filtered(rows: np.ndarray) -> bytes:
    """Return filtered rows, (h, w, bytes per texel) uint8, each after its filter type."""
    differences = rows.copy()
    differences[:, 1:] -= rows[:, :-1]
    numbers = np.full((len(rows), 1), _SUB, np.uint8)
    return np.concatenate([numbers, differences.reshape(len(rows), -1)], axis=1).tobytes()


def _chunk(name: bytes, data: bytes) -> bytes:
    """Return a chunk: length, name, data, and CRC-32 of name and data."""
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
