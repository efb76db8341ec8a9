"""OpenEXR files that tell which .blend they were written for."""

from __future__ import annotations

import struct
from pathlib import Path

import bpy
import numpy as np

from .files import try_to_write

#: Name of the header attribute that tells the owner.
_OWNER = b"hemibake_owner"

#: Magic number and version field.
_START = 8

#: Bytes of a pixel: four channels of 32 bits.
_PIXEL = 16


def write_exr(path: Path, pixels: np.ndarray, owner: str) -> None:
    """Write pixels, (h, w, 3) float32 scene-linear, bottom row first, bit-exact.

    Raises OSError or RuntimeError.
    `Image.save` converts generated float images to the display's colours unless they are marked as
    data, so a data image that lives only here is saved.
    """
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("hemibake", width, height, alpha=True, float_buffer=True, is_data=True)
    try:
        image.pixels.foreach_set(rgba(pixels))
        image.filepath_raw = str(path)
        image.file_format = "OPEN_EXR"
        image.save()
    except RuntimeError:
        # Blender takes a full disk for an invalid argument: writing as much tells what it was.
        try_to_write(path, image.size[0] * image.size[1] * _PIXEL)
        raise
    finally:
        bpy.data.images.remove(image)
    path.write_bytes(_with_owner(path.read_bytes(), owner.encode()))


def rgba(pixels: np.ndarray) -> np.ndarray:
    """Return (h, w, 3) as the flat RGBA float32 with alpha 1 that Blender wants."""
    result = np.ones((*pixels.shape[:2], 4), np.float32)
    result[..., :3] = pixels
    return result.reshape(-1)


def read_owner(path: Path) -> str | None:
    """Return the owner of an EXR file that Hemibake wrote, None for any other file; raises OSError."""
    with path.open("rb") as file:
        head = file.read(1 << 16)
    place = head.find(_OWNER + b"\0string\0")
    if place < 0:
        return None
    start = place + len(_OWNER) + 8
    (size,) = struct.unpack_from("<i", head, start)
    return head[start + 4 : start + 4 + size].decode(errors="replace")


def _with_owner(data: bytes, owner: bytes) -> bytes:
    """Return a single-part EXR file with the owner in its header.

    The header is a list of (name, type, size, value) that ends with an empty name; the table of the
    chunks' places in the file, uint64 each, follows, and then the chunks (OpenEXR file layout).
    """
    attribute = _OWNER + b"\0string\0" + struct.pack("<i", len(owner)) + owner
    end = _header_end(data)
    (first,) = struct.unpack_from("<Q", data, end)
    table = np.frombuffer(data[end:first], "<u8") + np.uint64(len(attribute))
    return data[: end - 1] + attribute + b"\0" + table.tobytes() + data[first:]


def _header_end(data: bytes) -> int:
    """Return where the header of a single-part EXR file ends."""
    place = _START
    while data[place]:
        kind = data.index(b"\0", place) + 1
        size = data.index(b"\0", kind) + 1
        place = size + 4 + struct.unpack_from("<i", data, size)[0]
    return place + 1
