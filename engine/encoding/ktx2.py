"""KTX 2.0 files of light as RGB9E5: three mantissas of 9 bits with one exponent (VK_FORMAT_E5B9G9R9)."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module

import numpy as np

#: Largest value of a channel: 511 / 512 times 2^16. Bias of the exponent, and its bits below the mantissa.
LARGEST = 65408.0
_BIAS, _MANTISSA = 15, 9

#: Identifier of the file, and VK_FORMAT_E5B9G9R9_UFLOAT_PACK32 with the size of its type.
_IDENTIFIER, _FORMAT, _TYPE_SIZE = b"\xabKTX 20\xbb\r\n\x1a\n", 123, 4

#: Bytes of the header with the index, and of the index of one level.
_HEADER, _LEVEL = 80, 24

#: Number of Zstandard in the header, and its level of compression: higher ones take longer and gain 1 %.
_ZSTANDARD, _EFFORT = 2, 9

#: Texels that are encoded at once.
_AT_ONCE = 1 << 18

#: Upper bound of a mantissa in the data format descriptor, as in files of the `ktx` tool.
_UPPER = 8448


def rgb9e5(light: np.ndarray) -> np.ndarray:
    """Return light, (..., 3) float, as (...,) uint32; negative and invalid values become 0.

    The exponent is the smallest for which the largest channel fits (Khronos, EXT_texture_shared_exponent).
    """
    colors = np.clip(np.nan_to_num(light.astype(np.float64), posinf=LARGEST), 0, LARGEST)
    largest = colors.max(axis=-1)
    exponent = np.floor(np.log2(np.maximum(largest, 2.0 ** -(_BIAS + 1)))).astype(np.int64) + _BIAS + 1
    exponent += np.floor(largest / _unit(exponent) + 0.5) == 1 << _MANTISSA
    mantissas = np.floor(colors / _unit(exponent)[..., None] + 0.5).astype(np.uint32)
    red, green, blue = np.moveaxis(mantissas, -1, 0)
    packed: np.ndarray = red | green << 9 | blue << 18 | exponent.astype(np.uint32) << 27
    return packed


def from_rgb9e5(packed: np.ndarray) -> np.ndarray:
    """Return the light of packed pixels, (...,) uint32, as (..., 3) float32."""
    unit = _unit((packed >> 27).astype(np.int64))
    channels = [(packed >> shift & 511) * unit for shift in (0, 9, 18)]
    return np.stack(channels, axis=-1).astype(np.float32)


def ktx2_volume(light: np.ndarray) -> bytes:
    """Return a 3D texture of light, (depth, height, width, 3) float, one level without compression."""
    depth, height, width = light.shape[:3]
    return _file((width, height, depth), 1, [light], b"rdi")


def ktx2_cube(levels: Sequence[np.ndarray]) -> bytes:
    """Return a cube map of light without compression.

    levels:  (6, s, s, 3) float each, top row first, each half as wide as the one before
    """
    size = levels[0].shape[1]
    return _file((size, size, 0), 6, levels, b"rd")


def ktx2_texture(levels: Sequence[np.ndarray]) -> bytes:
    """Return a 2D texture or an array of 2D textures of light.

    The levels are compressed by Zstandard if Python has the package zstandard, as in official Blender builds.

    levels:  (h, w, 3) or (layers, h, w, 3) float each, top row first, each half as wide as the one before
    """
    *layers, height, width, _ = levels[0].shape
    return _file((width, height, 0), 1, levels, b"rd", sum(layers), _zstandard())


def _file(
    size: tuple[int, int, int],
    faces: int,
    levels: Sequence[np.ndarray],
    orientation: bytes,
    layers: int = 0,
    compress: Callable[[bytes], bytes] | None = None,
) -> bytes:
    """Return a file of levels of light, (..., 3) float, the largest first.

    size:         width, height and depth of the first level
    orientation:  directions of the axes
    layers:       number of layers of an array; 0 without one
    compress:     compression by Zstandard; None to store the levels as they are
    """
    raw = [_packed(level) for level in levels]
    data = [compress(level) for level in raw] if compress else raw
    descriptor, facts = _descriptor(), _key_values(orientation)
    descriptor_at = _HEADER + _LEVEL * len(data)
    facts_at = descriptor_at + len(descriptor)
    level_at = facts_at + len(facts)
    level_at += 0 if compress else -level_at % 4
    scheme = _ZSTANDARD if compress else 0
    header = struct.pack("<9I", _FORMAT, _TYPE_SIZE, *size, layers, faces, len(data), scheme)
    index = struct.pack("<4I2Q", descriptor_at, len(descriptor), facts_at, len(facts), 0, 0)

    # The index lists the largest level first, the data begins with the smallest (KTX 2.0, 3.9.7).
    ends = level_at + np.cumsum([len(level) for level in reversed(data)])[::-1]
    places = [
        struct.pack("<3Q", end - len(level), len(level), len(before))
        for level, before, end in zip(data, raw, ends.tolist(), strict=True)
    ]
    start = (_IDENTIFIER + header + index + b"".join(places) + descriptor + facts).ljust(level_at, b"\0")
    return start + b"".join(reversed(data))


def _packed(light: np.ndarray) -> bytes:
    """Return the texels of a level, encoded in parts, because encoding needs several doubles a channel."""
    rows = light.reshape(-1, 3)
    parts = (rows[start : start + _AT_ONCE] for start in range(0, len(rows), _AT_ONCE))
    return b"".join(rgb9e5(part).astype("<u4").tobytes() for part in parts)


def _zstandard() -> Callable[[bytes], bytes] | None:
    """Return the compression by Zstandard; None if Python lacks the package."""
    try:
        zstandard = import_module("zstandard")
    except ImportError:
        return None
    compress: Callable[[bytes], bytes] = zstandard.ZstdCompressor(level=_EFFORT).compress
    return compress


def _unit(exponent: np.ndarray) -> np.ndarray:
    """Return the value of the lowest bit of a mantissa."""
    return np.exp2(exponent - float(_BIAS + _MANTISSA))


def _descriptor() -> bytes:
    """Return the data format descriptor: linear Rec.709, a mantissa and the exponent for each channel."""
    words = [0, 2 | (24 + 16 * 6) << 16, 1 | 1 << 8 | 1 << 16, 0, 4, 0]
    for channel in range(3):
        words += [9 * channel | 8 << 16 | channel << 24, 0, 0, _UPPER]
        words += [27 | 4 << 16 | (channel | 0x20) << 24, 0, _BIAS, 31]
    return struct.pack(f"<{len(words) + 1}I", 4 * len(words) + 4, *words)


def _key_values(orientation: bytes) -> bytes:
    """Return the metadata: directions of the axes, such as "rdi" for right, down and in, and the writer."""
    entries = [b"KTXorientation\0" + orientation + b"\0", b"KTXwriter\0Hemibake\0"]
    return b"".join(struct.pack("<I", len(entry)) + entry + b"\0" * (-len(entry) % 4) for entry in entries)


@dataclass(frozen=True)
class SharedExponent:
    """RGB9E5 in one channel of uint32; readers of KTX2 decode it."""

    @property
    def largest(self) -> float:
        """Largest light that can be stored."""
        return LARGEST

    @property
    def smallest(self) -> float:
        """Smallest light that is not stored as black: half of the smallest step, 2^-24."""
        return 2.0**-25

    @property
    def intensity(self) -> float:
        """Scale from decoded texels to light: 1, since RGB9E5 stores absolute values."""
        return 1.0

    @property
    def formula(self) -> str:
        """GLSL 3.30 expression of a texel that a reader has decoded."""
        return "light = intensity * rgb"

    def encode(self, light: np.ndarray) -> np.ndarray:
        """Encode light to texels, (h, w, 1) uint32."""
        return rgb9e5(light)[..., None]

    def decode(self, texels: np.ndarray) -> np.ndarray:
        """Decode texels to light, float32."""
        return from_rgb9e5(texels[..., 0])
