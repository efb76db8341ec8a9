"""Pictures of a screen as PNG files (W3C, Portable Network Graphics)."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np

#: Number of the filter "up" (section 9.2).
_UP = 2


def write_picture(pixels: np.ndarray, path: Path) -> None:
    """Write colours, (h, w, 3) uint8 sRGB, the top row first."""
    height, width, _ = pixels.shape

    # Filter "up" of each row: smooth pictures take the least as differences from the row above.
    rows = np.diff(pixels.reshape(height, -1), axis=0, prepend=np.zeros((1, 3 * width), np.uint8))
    rows = np.concatenate([np.full((height, 1), _UP, np.uint8), rows], axis=1)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b""))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(name, data) for name, data in chunks))


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
