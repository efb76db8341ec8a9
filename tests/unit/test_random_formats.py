"""Random light in random formats: the decoded light is within the documented limits."""

import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from engine.encoding.encoding import encode_in_bands, find_clipping
from engine.encoding.ktx2 import SharedExponent
from engine.encoding.logluv import LogLuv
from engine.encoding.png import png_bytes
from engine.encoding.radiance import radiance_bytes
from engine.encoding.rgbd import Rgbd
from engine.encoding.rgbe import Rgbe
from engine.encoding.rgbm import Rgbm
from engine.encoding.signed_norm import SignedNorm
from engine.encoding.srgb import Srgb

_RANGES = st.floats(1e-30, 1e30)
_GAMMAS = st.floats(1, 4)
_BITS = st.sampled_from([8, 16])

_ENCODINGS = st.one_of(
    st.builds(Srgb, st.floats(-60, 60), _BITS),
    st.builds(Rgbm, _RANGES, _GAMMAS),
    st.builds(Rgbd, _RANGES, _GAMMAS),
    st.just(LogLuv()),
    st.just(Rgbe()),
    st.just(SharedExponent()),
)

_SHAPES = st.tuples(st.integers(1, 7), st.integers(1, 11), st.just(3))

#: Largest error, relative to the brightest channel, of light that is neither clipped nor near to black.
_ERRORS = {Srgb: 0.05, Rgbm: 0.05, Rgbd: 0.12, LogLuv: 0.03, Rgbe: 0.005, SharedExponent: 0.003}

_FUZZ = settings(
    max_examples=200, derandomize=True, database=None, deadline=None, suppress_health_check=list(HealthCheck)
)


#: Nearly the largest numbers of 32 bits, and those of signed maps.
_MOST, _MOST_SIGNED = float(np.float32(3e38)), float(np.float32(1e30))


def dimmest(encoding):
    """Return the light above which half a step of an 8-bit colour changes it by at most a twentieth."""
    gamma = getattr(encoding, "gamma", 1)
    return max(400, (20 * gamma) ** gamma) * encoding.smallest


def lights(low=0.0, high=_MOST):
    """Return light of any shape and brightness."""
    values = st.floats(low, high, width=32) | st.sampled_from([0.0, 1.0, float(np.float32(1e-45))])
    return _SHAPES.flatmap(lambda shape: arrays(np.float32, shape, elements=values))


@_FUZZ
@given(_ENCODINGS, lights())
def test_any_light_in_any_format(encoding, light):
    """Clipped light has the maximum, dark light may become black, and all other light is restored."""
    with np.errstate(over="ignore"):
        texels = encode_in_bands(encoding, light)
        decoded = encoding.decode(texels).astype(np.float64)
    assert texels.shape[:2] == light.shape[:2] and texels.dtype.kind == "u"
    assert (decoded >= 0).all() and not np.isnan(decoded).any()
    clipping = find_clipping(light, encoding, np.ones(light.shape[:2], bool))
    brightest = light.max(axis=-1).astype(np.float64)
    assert not decoded[brightest == 0].any()
    enough = ~clipping.bright & (brightest > dimmest(encoding))
    error = np.abs(decoded - light).max(axis=-1)[enough]
    assert (error <= _ERRORS[type(encoding)] * brightest[enough]).all()
    if not isinstance(encoding, LogLuv):
        assert (decoded[clipping.bright].max(axis=-1) >= 0.98 * min(encoding.largest, 3.4e38)).all()


@_FUZZ
@given(_RANGES, _BITS, lights(-_MOST_SIGNED, _MOST_SIGNED))
def test_any_signed_map_comes_back_to_a_step(range, bits, values):
    encoding = SignedNorm(range, bits)
    decoded = encoding.decode(encode_in_bands(encoding, values)).astype(np.float64)
    held = np.clip(values, -range, range)
    assert np.abs(decoded - held).max() <= 1.01 * range / (2**bits - 1)


@_FUZZ
@given(st.sampled_from([np.uint8, np.uint16]), st.sampled_from([3, 4]), st.booleans(), st.data())
def test_any_texels_in_a_png(depth, channels, srgb, data):
    """Read back by the definition of the filter, chunk by chunk."""
    shape = data.draw(st.tuples(st.integers(1, 9), st.integers(1, 9), st.just(channels)))
    texels = data.draw(arrays(depth, shape))
    file = png_bytes(texels, srgb)
    at, rows = 8, b""
    while at < len(file):
        length = int.from_bytes(file[at : at + 4], "big")
        name, body = file[at + 4 : at + 8], file[at + 8 : at + 8 + length]
        rows += body if name == b"IDAT" else b""
        at += 12 + length
    lines = np.frombuffer(zlib.decompress(rows), np.uint8).reshape(len(texels), -1)
    size = channels * texels.itemsize
    levels = np.cumsum(lines[:, 1:].reshape(len(texels), -1, size), axis=1, dtype=np.uint64).astype(np.uint8)
    read = levels.reshape(len(texels), -1).view(f">u{texels.itemsize}").reshape(shape)
    assert (read[::-1] == texels).all()


@_FUZZ
@given(st.integers(1, 300), st.integers(1, 5), st.integers(0, 2**32 - 1), st.integers(1, 255))
def test_any_texels_in_a_radiance_picture_are_no_longer_than_plain_ones(width, height, seed, levels):
    """Rows of runs, of noise, and of both."""
    texels = np.random.default_rng(seed).integers(0, levels, (height, width, 4)).astype(np.uint8)
    file = radiance_bytes(texels)
    assert file.startswith(b"#?RADIANCE\n") and f"-Y {height} +X {width}\n".encode() in file[:99]
    assert len(file) <= 99 + height * (4 + 4 * (width + width // 128 + 1))


@pytest.mark.parametrize("encoding", [SignedNorm(), Srgb(0.0, 16)])
def test_largest_level_is_the_largest_value(encoding):
    assert encoding.encode(np.full((1, 1, 3), encoding.largest, np.float32)).max() == 65535


@pytest.mark.parametrize("range", [140679925523175.0, 0.1, 3.0, 255 / 7])
def test_brightest_light_of_rgbd_has_a_divisor(range):
    """Divided by the intensity, it can be a rounding more than 255."""
    encoding = Rgbd(range, 1.0)
    light = np.full((1, 1, 3), np.nextafter(np.float32(range), np.float32(np.inf)), np.float32)
    assert encoding.encode(light)[0, 0].tolist() == [255, 255, 255, 1]
