import numpy as np
import pytest

from engine.errors import PatchFileError
from engine.patch_file import read_patches, write_patches
from engine.patches import PatchList


@pytest.fixture
def patches():
    rng = np.random.default_rng(3)
    integers = [rng.integers(0, 1000, 50).astype(np.int32) for _ in range(5)]
    return PatchList(64, *integers, rng.random((50, 3), np.float32))


def test_round_trip_keeps_every_bit(patches, tmp_path):
    write_patches(tmp_path / "a.patches", patches)
    loaded = read_patches(tmp_path / "a.patches")
    assert loaded.resolution == 64
    for name in ("atlas", "texel", "mesh", "face", "subface", "barycentric"):
        before, after = getattr(patches, name), getattr(loaded, name)
        assert before.dtype == after.dtype and (before == after).all()


@pytest.mark.parametrize("length", [9, 20, 28, 200])
def test_truncated_file(patches, tmp_path, length):
    path = tmp_path / "a.patches"
    write_patches(path, patches)
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(PatchFileError, match="a.patches.*(header|truncated)"):
        read_patches(path)


def test_foreign_file(tmp_path):
    path = tmp_path / "a.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    with pytest.raises(PatchFileError, match="not a Hemibake patch file"):
        read_patches(path)


def test_damaged_body_and_other_version(patches, tmp_path):
    path = tmp_path / "a.patches"
    write_patches(path, patches)
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    with pytest.raises(PatchFileError, match="checksum"):
        read_patches(path)
    data[8] = 99
    path.write_bytes(data)
    with pytest.raises(PatchFileError, match="version 99"):
        read_patches(path)
