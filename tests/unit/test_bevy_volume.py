"""KTX2 files of RGB9E5, and the voxels of Bevy's irradiance volumes."""

import struct

import numpy as np
import pytest

from engine.encoding.ktx2 import LARGEST, from_rgb9e5, ktx2_volume, rgb9e5
from engine.probes.bevy_volume import bevy_voxels
from engine.probes.spherical_harmonics import basis, irradiance

RANDOM = np.random.default_rng(2)


def test_rgb9e5_keeps_the_brightest_channel_within_a_fifth_of_a_percent():
    light = np.exp(RANDOM.uniform(-9, 10, (1001, 1))) * RANDOM.uniform(0.05, 1, (1001, 3))
    found = from_rgb9e5(rgb9e5(light))
    assert (np.abs(found - light).max(axis=1) <= 0.00196 * light.max(axis=1)).all()


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, 1e-12])
def test_what_is_not_light_is_black(value):
    assert not from_rgb9e5(rgb9e5(np.full((2, 3), value))).any()


@pytest.mark.parametrize(("value", "expected"), [(1e9, LARGEST), (np.inf, LARGEST), (511.9, 512), (1.0, 1)])
def test_large_values_and_round_ones(value, expected):
    assert (from_rgb9e5(rgb9e5(np.full((1, 3), value))) == expected).all()


def test_a_file_has_the_header_and_the_pixels():
    light = RANDOM.random((5, 3, 7, 3)).astype(np.float32)
    data = ktx2_volume(light)
    assert data[:12] == b"\xabKTX 20\xbb\r\n\x1a\n"
    assert struct.unpack_from("<9I", data, 12) == (123, 4, 7, 3, 5, 0, 1, 1, 0)
    facts_at, facts_size = struct.unpack_from("<2I", data, 56)
    (level_at, size, raw) = struct.unpack_from("<3Q", data, 80)
    assert level_at % 4 == 0 and level_at >= facts_at + facts_size
    assert size == raw == 4 * 5 * 3 * 7 == len(data) - level_at
    assert struct.unpack_from("<I", data, 104) == (124,) and b"KTXorientation\0rdi\0" in data
    packed = np.frombuffer(data, "<u4", offset=level_at).reshape(5, 3, 7)
    assert from_rgb9e5(packed) == pytest.approx(light, abs=2e-3)


def test_voxels_hold_the_sides_of_world_axes_with_y_up():
    """Light at one probe from above and from +x; the shader reads voxel (x, y + half, z + axis * depth)."""
    resolution = x, y, z = 2, 3, 4
    coefficients = np.zeros((x * y * z, 9, 3), np.float32)
    i, j, k = 1, 0, 2
    lit = basis(np.array([[1.0, 0, 0], [0, 0, 1]])) * [[1], [2]]
    coefficients[(k * y + j) * x + i] = lit.sum(axis=0)[:, None]
    voxels = bevy_voxels(coefficients, resolution)
    assert voxels.shape == (3 * y, 2 * z, x, 3)
    probe = coefficients[[(k * y + j) * x + i]]
    for axis, blender in enumerate(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])):
        for side, normal in enumerate((blender, -blender)):
            expected = max(float(irradiance(probe, normal[None])[0, 0, 0]), 0.0)
            value = voxels[(y - 1 - j) + axis * y, k + side * z, i, 0]
            assert value == pytest.approx(expected, abs=1e-6)
    assert np.count_nonzero(voxels.any(axis=-1)) <= 6
