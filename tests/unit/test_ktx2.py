"""KTX2 textures of lightmaps: arrays, mip levels inside charts, and Zstandard."""

import struct
import sys

import numpy as np
import pytest

from engine.encoding.encoding import find_clipping
from engine.encoding.ktx2 import SharedExponent, from_rgb9e5, ktx2_texture
from engine.postprocess.chart_mips import chart_mips

RANDOM = np.random.default_rng(38)


def read(data):
    """Return size, layers, scheme and the texels of each level of a file, the largest first."""
    assert data[:12] == b"\xabKTX 20\xbb\r\n\x1a\n"
    kind, size_of_type, width, height, depth, layers, faces, count, scheme = struct.unpack_from(
        "<9I", data, 12
    )
    assert (kind, size_of_type, depth, faces) == (123, 4, 0, 1)
    descriptor, length, facts, facts_length = struct.unpack_from("<4I", data, 48)
    assert descriptor == 80 + 24 * count and facts == descriptor + length
    assert struct.unpack_from("<I", data, descriptor) == (length,) == (124,)
    assert b"KTXorientation\0rd\0" in data[facts : facts + facts_length]
    levels, end = [], len(data)
    places = [struct.unpack_from("<3Q", data, 80 + 24 * level) for level in range(count)]
    for level, (start, stored, raw) in enumerate(places):
        assert start + stored == end and (scheme or (start % 4 == 0 and stored == raw))
        end = start
        part = data[start : start + stored]
        if scheme:
            import zstandard

            part = zstandard.ZstdDecompressor().decompress(part)
        assert len(part) == raw
        shape = (layers or 1, max(height >> level, 1), max(width >> level, 1))
        levels.append(from_rgb9e5(np.frombuffer(part, "<u4").reshape(shape)))
    assert facts + facts_length <= end
    return (width, height), layers, scheme, levels


@pytest.fixture(params=["zstandard", "raw"])
def scheme(request, monkeypatch):
    """Provide the scheme of files with and without the package."""
    if request.param == "raw":
        monkeypatch.setitem(sys.modules, "zstandard", None)
        return 0
    pytest.importorskip("zstandard")
    return 2


def test_a_texture_holds_its_levels(scheme):
    levels = [RANDOM.random((max(22 >> k, 1), 26 >> k, 3)).astype(np.float32) for k in range(5)]
    size, layers, found, texels = read(ktx2_texture(levels))
    assert (size, layers, found) == ((26, 22), 0, scheme)
    for expected, (level,) in zip(levels, texels, strict=True):
        assert level == pytest.approx(expected, abs=2e-3)


def test_an_array_holds_its_layers(scheme):
    light = 1000 * RANDOM.random((3, 5, 7, 3)).astype(np.float32)
    size, layers, found, (texels,) = read(ktx2_texture([light]))
    assert (size, layers, found) == ((7, 5), 3, scheme)
    assert texels == pytest.approx(light, abs=2)


def test_zstandard_makes_smooth_light_smaller():
    pytest.importorskip("zstandard")
    smooth = np.linspace(0, 1, 64 * 64 * 3, dtype=np.float32).reshape(64, 64, 3)
    assert len(ktx2_texture([np.round(smooth, 1)])) < 64 * 64


def test_the_encoding_clips_as_it_says():
    encoding, light = SharedExponent(), np.array([[[1e9, 1, 1], [1e-9, 0, 0], [0.25, 0, 0]]], np.float32)
    clipping = find_clipping(light, encoding, np.ones((1, 3), bool))
    assert clipping.bright.tolist() == [[True, False, False]]
    assert clipping.dark.tolist() == [[False, True, False]]
    decoded = encoding.decode(encoding.encode(light))
    assert decoded[0, 0, 0] == encoding.largest and not decoded[0, 1].any() and decoded[0, 2, 0] == 0.25
    edge = np.full((1, 1, 3), encoding.smallest, np.float32)
    assert encoding.decode(encoding.encode(edge)).all() and not encoding.encode(0.99 * edge).any()


def two_charts(gap, size=64):
    """Return charts of light 1 and 3 that are a gap apart, with red gutters, and the mask of the charts."""
    light, mask = np.zeros((size, size, 3), np.float32), np.zeros((size, size), bool)
    light[..., 0] = 100
    middle = 21
    light[5:40, 3:middle], light[5:40, middle + gap : 60] = 1, 3
    mask[5:40, 3:middle] = mask[5:40, middle + gap : 60] = True
    return light, mask


@pytest.mark.parametrize("gap", [1, 3, 7])
def test_levels_never_mix_charts(gap):
    light, mask = two_charts(gap)
    levels = chart_mips(light, mask)
    assert [len(level) for level in levels] == [64, 32, 16, 8, 4, 2, 1] and (levels[0] == light).all()
    for number, level in enumerate(levels[1:], 1):
        assert level.shape == (64 >> number, 64 >> number, 3)
        covered = mask.reshape(64 >> number, 1 << number, 64 >> number, 1 << number).any(axis=(1, 3))
        assert set(np.unique(level[covered])) <= {1, 3}
    assert set(np.unique(levels[3][mask[::8, ::8]])) == {1, 3}


def test_texels_next_to_a_chart_repeat_its_light():
    light, mask = two_charts(15)
    (row, *_), columns = np.nonzero(mask[::2, ::2])
    level, last = chart_mips(light, mask)[1], columns[columns < 15].max()
    assert (level[row + 3, last + 1 :][:1] == 1).all() and level[row + 3, last + 3, 0] == 100


def test_a_level_is_the_mean_of_the_texels_of_a_chart():
    light, mask = RANDOM.random((8, 12, 3)).astype(np.float32), np.ones((8, 12), bool)
    mask[0, 0] = False
    first = chart_mips(light, mask)[1]
    assert first[1, 2] == pytest.approx(light[2:4, 4:6].mean(axis=(0, 1)))
    assert first[0, 0] == pytest.approx((light[0, 1] + light[1, 0] + light[1, 1]) / 3)


@pytest.mark.parametrize(
    ("shape", "sizes"),
    [((7, 12), [(7, 12), (3, 6), (1, 3), (1, 1)]), ((1, 1), [(1, 1)]), ((5, 1), [(5, 1), (2, 1), (1, 1)])],
)
def test_levels_of_any_size(shape, sizes):
    for mask in (np.ones(shape, bool), np.zeros(shape, bool)):
        levels = chart_mips(np.full((*shape, 3), 2, np.float32), mask)
        assert [level.shape[:2] for level in levels] == sizes and all((level == 2).all() for level in levels)
