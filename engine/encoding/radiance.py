"""Radiance HDR encoder (.hdr)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

#: Image widths for which the format of 1991 allows run-length encoding; others are stored uncompressed.
_WIDTHS = range(8, 1 << 15)

#: Maximum lengths of a run and of a literal stretch, and minimum length of a run, bytes.
_LONGEST_RUN, _LONGEST_PLAIN, _SHORTEST_RUN = 127, 128, 4


def radiance_bytes(texels: np.ndarray) -> bytes:
    """Return a Radiance HDR file of RGBE texels, (h, w, 4) uint8, bottom row first.

    Format: Ward 1991, "Real Pixels", Graphics Gems II, chapter 5, and Radiance's `color.c`. A row consists of
        the bytes 2, 2, the width in two bytes, and the run-length code of each channel.
    """
    height, width = texels.shape[:2]
    header = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()
    rows = texels[::-1]
    if width not in _WIDTHS:
        return header + rows.tobytes()
    start = bytes((2, 2, width >> 8, width & 0xFF))
    return header + b"".join(start + b"".join(_channels(row)) for row in rows)


def run_lengths(channel: np.ndarray) -> Iterator[bytes]:
    """Yield the run-length code of (w,) uint8: runs (128 + length, byte) and literals (length, bytes)."""
    data, plain_from = channel.tobytes(), 0
    starts = np.flatnonzero(np.diff(channel, prepend=~channel[:1]))
    lengths = np.diff(starts, append=len(channel))
    for start, length in zip(
        starts[lengths >= _SHORTEST_RUN], lengths[lengths >= _SHORTEST_RUN], strict=True
    ):
        yield from _plain(data[plain_from:start])
        yield from _runs(data[start : start + 1], int(length))
        plain_from = start + length
    yield from _plain(data[plain_from:])


def _channels(row: np.ndarray) -> Iterator[bytes]:
    """Yield the run-length code of each channel of a row, (w, 4)."""
    for channel in np.ascontiguousarray(row.T):
        yield from run_lengths(channel)


def _runs(byte: bytes, length: int) -> Iterator[bytes]:
    for start in range(0, length, _LONGEST_RUN):
        yield bytes((128 + min(_LONGEST_RUN, length - start),)) + byte


def _plain(data: bytes) -> Iterator[bytes]:
    for start in range(0, len(data), _LONGEST_PLAIN):
        part = data[start : start + _LONGEST_PLAIN]
        yield bytes((len(part),)) + part
