"""Reads the picture of an X server from the file of Xvfb (X11/XWDFile.h)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

#: Words of the header, big-endian uint32.
_HEADER_SIZE, _WIDTH, _HEIGHT, _BYTES_PER_LINE, _COLOURS = 0, 4, 5, 12, 19
_WORDS = 25

#: Length of an entry of the colour map, bytes.
_COLOUR_SIZE = 12


def read_screen(path: Path) -> np.ndarray:
    """Return the picture of a screen of 24 bits, (h, w, 3) uint8, the top row first."""
    data = path.read_bytes()
    words = np.frombuffer(data, ">u4", _WORDS).astype(int)
    start = words[_HEADER_SIZE] + _COLOUR_SIZE * words[_COLOURS]
    shape = (words[_HEIGHT], words[_BYTES_PER_LINE] // 4, 4)
    pixels = np.frombuffer(data, np.uint8, int(np.prod(shape)), start).reshape(shape)
    return pixels[:, : words[_WIDTH], 2::-1]


def difference(first: np.ndarray, second: np.ndarray, box: tuple[int, int, int, int]) -> tuple | None:
    """Return left, top, right and bottom of where two pictures differ within such a box; None if nowhere."""
    left, top, right, bottom = box
    differ = (first != second).any(axis=2)[top:bottom, left:right]
    if not differ.any():
        return None
    rows, columns = np.flatnonzero(differ.any(axis=1)), np.flatnonzero(differ.any(axis=0))
    return left + columns[0], top + rows[0], left + columns[-1], top + rows[-1]
