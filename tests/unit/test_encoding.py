"""Light in the formats that engines read, there and back again."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from engine.encoding.encoding import encode_in_bands, find_clipping
from engine.encoding.half import Half
from engine.encoding.ktx2 import SharedExponent
from engine.encoding.logluv import LogLuv
from engine.encoding.png import png_bytes
from engine.encoding.radiance import radiance_bytes
from engine.encoding.rgbd import Rgbd
from engine.encoding.rgbe import Rgbe
from engine.encoding.rgbm import Rgbm
from engine.encoding.signed_norm import SignedNorm
from engine.encoding.srgb import Srgb

ROOT = Path(__file__).resolve().parents[2]

ENCODINGS = [
    Srgb(),
    Srgb(-3.7),
    Srgb(1.3, 16),
    Rgbm(34.493242),
    Rgbm(64.0, 2.0),
    Rgbm(0.013, 1.0),
    Rgbd(255.0),
    Rgbd(7.1, 1.0),
    LogLuv(),
    Rgbe(),
    SharedExponent(),
]


def colours(low: float, high: float, shape=(23, 41), seed=3) -> np.ndarray:
    """Return colours whose brightest channel is between two values, evenly in its logarithm."""
    generator = np.random.default_rng(seed)
    hue = generator.random((*shape, 3)) ** 2
    hue /= hue.max(axis=-1, keepdims=True)
    brightest = np.exp(generator.uniform(np.log(low), np.log(high), (*shape, 1)))
    return (hue * brightest).astype(np.float32)


def errors(encoding, light: np.ndarray) -> np.ndarray:
    """Return the error of each colour after encoding and decoding, relative to its length."""
    difference = encoding.decode(encoding.encode(light)).astype(float) - light
    return np.linalg.norm(difference, axis=-1) / np.linalg.norm(light.astype(float), axis=-1)


@pytest.mark.parametrize(
    ("encoding", "low", "bound"),
    [
        (Srgb(-3.7), 0.2, 0.03),
        (Srgb(-3.7, 16), 0.02, 0.001),
        (Rgbm(34.493242), 1e-2, 0.01),
        (Rgbm(64.0, 2.0), 1e-2, 0.01),
        (Rgbm(0.013, 1.0), 0.002, 0.02),
        (Rgbd(255.0), 1e-2, 0.05),
        (Rgbd(7.1, 1.0), 0.03, 0.06),
        (LogLuv(), 1e-6, 0.02),
        (Rgbe(), 1e-30, 0.008),
    ],
)
def test_light_comes_back(encoding, low, bound):
    light = colours(low, min(encoding.largest, 10.0))
    texels = encoding.encode(light)
    assert texels.dtype == (np.uint16 if encoding == Srgb(-3.7, 16) else np.uint8)
    assert texels.shape[:2] == light.shape[:2] and texels.shape[2] in (3, 4)
    assert encoding.decode(texels).dtype == np.float32
    assert errors(encoding, light).max() < bound


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_black_stays_black_and_bright_light_is_clipped(encoding):
    brightest = min(encoding.largest, 1e38)
    light = np.array([[[0, 0, 0], [3e38, 3e38, 3e38], [np.inf, 0, 0]]], np.float32)
    black, white, red = encoding.decode(encoding.encode(light))[0]
    assert (black == 0).all()
    assert white == pytest.approx(brightest, rel=0.02) or (white > 1e18).all()
    assert red[0] > 0.9 * white[0] and red[1:].max() < 0.01 * red[0]


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_largest_is_not_clipped(encoding):
    light = np.full((1, 1, 3), min(encoding.largest, 1.5e38), np.float32)
    assert encoding.decode(encoding.encode(light)) == pytest.approx(light, rel=0.02)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_smallest_is_the_border_of_black(encoding):
    light = np.zeros((2, 3), np.float64)
    light[0, 2], light[1, 2] = 1.001 * encoding.smallest, 0.99 * encoding.smallest
    above, below = encoding.encode(light[None])[0]
    if isinstance(encoding, LogLuv):
        assert above[:2].any() and not below[:2].any()
        return
    black = encoding.encode(np.zeros((1, 1, 3)))[0, 0]
    assert (above[:3] != black[:3]).any() and (below[:3] == black[:3]).all()


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_second_round_changes_nothing_more_than_a_step(encoding):
    light = colours(1e-3, min(encoding.largest, 10.0))
    once = encoding.decode(encoding.encode(light))
    lit = once.max(axis=-1) > 30 * encoding.smallest
    assert errors(encoding, once[lit][None]).max() < 0.02


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("range", [1e-3, 1.0, 7.5])
def test_biased_maps_keep_both_signs(range, bits):
    """To half a step."""
    encoding = SignedNorm(range, bits)
    values = np.random.default_rng(bits).uniform(-range, range, (23, 41, 3)).astype(np.float32)
    values[0, 0], values[0, 1] = range, -range
    texels = encoding.encode(values)
    decoded = encoding.decode(texels)
    assert texels.itemsize == bits // 8 and decoded.dtype == np.float32
    assert np.abs(decoded - values).max() <= 1.001 * range / (2**bits - 1)
    assert (decoded[0, :2] == values[0, :2]).all()
    assert (encoding.encode(3 * values) == encoding.encode(np.clip(3 * values, -range, range))).all()


def test_bands_are_the_whole():
    light = colours(1e-3, 10, (997, 541))
    assert (encode_in_bands(Rgbm(10.0), light) == Rgbm(10.0).encode(light)).all()


def test_radiance_of_known_bytes():
    """2^(e - 136) * mantissa: 1 is 128 * 2^-7."""
    light = np.array([[[1.0, 0.5, 0.25], [255.9, 0.0, 1.1], [0.999, 0.0, 0.0]]], np.float32)
    texels = Rgbe().encode(light)
    assert texels.tolist() == [[[128, 64, 32, 129], [128, 0, 1, 137], [128, 0, 0, 129]]]


def test_luminance_and_chromaticity_of_white():
    """Larson 1998: Le = floor(256 (log2 Y + 64)), u' and v' of D65 are 0.1978 and 0.4683."""
    texels = LogLuv().encode(np.ones((1, 1, 3), np.float32) * 1.0001)
    assert texels.tolist() == [[[0x40, 0, int(410 * 0.1978), int(410 * 0.4683)]]]


def test_decoder_of_unity_gives_the_same():
    """34.493242 a^2.2 of a colour that was decoded from sRGB, nearly the power of 2.2."""
    encoding = Rgbm(34.493242)
    light = colours(0.05, 30.0)
    texels = encoding.encode(light).astype(np.float64) / 255
    decoded = 34.493242 * texels[..., 3:] ** 2.2 * texels[..., :3] ** 2.2
    assert decoded == pytest.approx(light, rel=0.2, abs=0.02)
    assert errors(encoding, light).mean() < 0.004


def read_png(data: bytes) -> tuple[list[bytes], np.ndarray]:
    """Return the names of the chunks of a PNG, and its texels, top row first."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    chunks, at = [], 8
    while at < len(data):
        (length,) = struct.unpack_from(">I", data, at)
        name, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + length]
        assert struct.unpack_from(">I", data, at + 8 + length)[0] == zlib.crc32(name + body)
        chunks.append((name, body))
        at += 12 + length
    header = dict(chunks)[b"IHDR"]
    width, height, depth, colour_type = struct.unpack_from(">IIBB", header)
    channels = {2: 3, 6: 4}[colour_type]
    rows = np.frombuffer(zlib.decompress(dict(chunks)[b"IDAT"]), np.uint8).reshape(height, -1)
    assert depth in (8, 16) and (rows[:, 0] == 1).all()
    differences = rows[:, 1:].reshape(height, width, channels * depth // 8)
    texels = np.cumsum(differences, axis=1, dtype=np.uint64).astype(np.uint8)
    return [name for name, _ in chunks], texels.view(f">u{depth // 8}")


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("srgb", [False, True])
@pytest.mark.parametrize("depth", [np.uint8, np.uint16])
def test_png_holds_the_texels(channels, srgb, depth):
    texels = np.random.default_rng(1).integers(0, np.iinfo(depth).max, (13, 29, channels), depth)
    names, read = read_png(png_bytes(texels, srgb))
    assert (read[::-1] == texels).all()
    assert names == [b"IHDR", *([b"sRGB"] if srgb else []), b"IDAT", b"IEND"]


def read_radiance(data: bytes) -> np.ndarray:
    """Return the texels of a Radiance picture, top row first."""
    header, _, data = data.partition(b"\n\n")
    assert header.startswith(b"#?RADIANCE\n") and b"FORMAT=32-bit_rle_rgbe" in header
    size, _, data = data.partition(b"\n")
    _, height, _, width = size.split()
    height, width = int(height), int(width)
    if not 8 <= width < 1 << 15:
        return np.frombuffer(data, np.uint8).reshape(height, width, 4)
    rows, at = np.zeros((height, 4, width), np.uint8), 0
    for row in rows:
        assert data[at : at + 4] == bytes((2, 2, width >> 8, width & 255))
        at += 4
        for channel in row:
            done = 0
            while done < width:
                count, at = data[at], at + 1
                if count > 128:
                    channel[done : done + count - 128] = data[at]
                    done, at = done + count - 128, at + 1
                else:
                    channel[done : done + count] = list(data[at : at + count])
                    done, at = done + count, at + count
            assert done == width
    assert at == len(data)
    return rows.transpose(0, 2, 1)


@pytest.mark.parametrize("width", [1, 7, 8, 127, 128, 129, 257, 1021])
def test_radiance_picture_holds_the_texels(width):
    """Rows of noise, of one colour, and of runs of all lengths."""
    generator = np.random.default_rng(width)
    noise = generator.integers(0, 256, (3, width, 4), np.uint8)
    plain = np.full((2, width, 4), 128, np.uint8)
    runs = np.repeat(generator.integers(0, 3, (5, width, 4), np.uint8), 7, axis=1)[:, :width]
    texels = np.concatenate([noise, plain, runs])
    data = radiance_bytes(texels)
    assert (read_radiance(data)[::-1] == texels).all()
    if width > 1000:
        assert len(data) < 0.8 * texels.size


def test_table_of_the_documentation_holds(monkeypatch):
    """The errors in docs/reference/formats.md equal the present errors of formats that need no Blender."""
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import formats

    told, losses = formats.told(), formats.losses_of_encodings()
    assert set(told) == set(losses) | set(formats.OPENEXR)
    for name, loss in losses.items():
        assert [loss.mean, loss.p99, loss.dark] == pytest.approx(told[name], rel=0.06), name


def test_clipping_is_of_counted_texels_alone():
    light = np.zeros((3, 5, 3), np.float32)
    light[0, 1], light[1, 2, 2], light[2, 3, 0], light[2, 4] = 5, 2.5, 1e-7, (0.1, 2, 0)
    counted = np.ones((3, 5), bool)
    counted[0, 1] = False
    clipping = find_clipping(light, Srgb(-1.0), counted)
    assert np.argwhere(clipping.bright).tolist() == [[1, 2]]
    assert np.argwhere(clipping.dark).tolist() == [[2, 3]]
    assert not find_clipping(light, Half(), counted).dark.any()
    light[0, 0] = (3, -7e4, 0)
    assert np.argwhere(find_clipping(light, Half(), counted).bright).tolist() == [[0, 0]]
    assert np.argwhere(find_clipping(light, SignedNorm(4.0), counted).bright).tolist() == [[0, 0]]
