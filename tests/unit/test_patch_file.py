from dataclasses import replace

import numpy as np
import pytest

from engine.errors import PatchFileError
from engine.patch_file import read_patches, write_patches
from engine.patches import PatchList
from tests.analytic.scenes import furnace


@pytest.fixture
def scene():
    return furnace(0.5, 1.0)


@pytest.fixture
def patches():
    rng = np.random.default_rng(3)
    integers = [rng.integers(0, 1000, 50).astype(np.int32) for _ in range(5)]
    return PatchList(64, *integers, rng.random((50, 3), np.float32))


@pytest.fixture
def path(tmp_path, scene, patches):
    write_patches(tmp_path / "a.patches", scene, patches)
    return tmp_path / "a.patches"


def test_round_trip_keeps_every_bit(path, scene, patches):
    loaded = read_patches(path, scene, 64)
    assert loaded.resolution == 64
    for name in ("atlas", "texel", "mesh", "face", "subface", "barycentric"):
        before, after = getattr(patches, name), getattr(loaded, name)
        assert before.dtype == after.dtype and (before == after).all()


@pytest.mark.parametrize("length", [9, 20, 32, 200])
def test_truncated_file(path, scene, length):
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(PatchFileError, match="a.patches.*(header|truncated)"):
        read_patches(path, scene, 64)


def test_foreign_file(tmp_path, scene):
    path = tmp_path / "a.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    with pytest.raises(PatchFileError, match="not a Hemibake patch file"):
        read_patches(path, scene, 64)


def test_damaged_body_and_other_version(path, scene):
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    with pytest.raises(PatchFileError, match="checksum"):
        read_patches(path, scene, 64)
    data[8] = 99
    path.write_bytes(data)
    with pytest.raises(PatchFileError, match="version 99"):
        read_patches(path, scene, 64)


def test_another_resolution_or_other_charts(path, scene):
    with pytest.raises(PatchFileError, match="made for 64 x 64"):
        read_patches(path, scene, 128)
    moved = replace(scene.meshes[0], uvs=scene.meshes[0].uvs * np.float32(0.5))
    with pytest.raises(PatchFileError, match="UVs have changed"):
        read_patches(path, replace(scene, meshes=(moved,)), 64)


def test_places_that_cannot_be_used(path, tmp_path, scene, patches):
    with pytest.raises(PatchFileError, match="cannot be written.*Choose another place"):
        write_patches(path / "a.patches", scene, patches)
    with pytest.raises(PatchFileError, match="cannot be read"):
        read_patches(tmp_path, scene, 64)
