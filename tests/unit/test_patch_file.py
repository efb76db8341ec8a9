import errno
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine.errors import PatchFileError
from engine.patches.patch_file import read_patches, write_patches
from engine.reference.cpu_patches import list_patches
from tests.analytic.scenes import furnace


@pytest.fixture
def scene():
    """Two meshes in two atlases; the second one has polygons of two triangles and of one."""
    room = furnace(0.5, 1.0)
    other = room.meshes[0].part(np.arange(12) != 3)
    return replace(room, meshes=(*room.meshes, replace(other, atlas=1)), atlases=("Room", "Other"))


@pytest.fixture
def patches(scene):
    return list_patches(scene, 64)


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


@pytest.mark.parametrize(
    ("name", "index", "value"),
    [("atlas", 0, -1), ("atlas", -1, 2), ("atlas", 0, 1), ("texel", 0, -1), ("texel", -1, 64 * 64),
     ("texel", -1, 2**31 - 1), ("texel", 7, 0), ("mesh", 5, -1), ("mesh", 5, 2), ("mesh", 5, 2**31 - 1),
     ("mesh", 5, 1), ("face", 9, -1), ("face", 9, 6), ("face", 9, 2**31 - 1), ("subface", 3, -1),
     ("subface", 3, 2), ("subface", 3, 2**31 - 1), ("barycentric", 4, np.nan), ("barycentric", 4, np.inf),
     ("barycentric", 4, -0.5), ("barycentric", 4, 0.9)],
)  # fmt: skip
def test_wrong_contents_with_right_checksums(tmp_path, scene, patches, name, index, value):
    changed = getattr(patches, name).copy()
    changed[index] = value
    write_patches(tmp_path / "a.patches", scene, replace(patches, **{name: changed}))
    with pytest.raises(PatchFileError, match="a.patches' has patches that are not in the scene.*[.] Delete"):
        read_patches(tmp_path / "a.patches", scene, 64)


def test_a_triangle_that_is_missing_and_no_patches_at_all(tmp_path, scene, patches):
    """Polygon 1 of the second mesh has only its first triangle."""
    last = np.flatnonzero((patches.mesh == 1) & (patches.face == 1))[-1:]
    changed = patches.subface.copy()
    changed[last] = 1
    for wrong in (replace(patches, subface=changed), patches.part(last[:0])):
        write_patches(tmp_path / "a.patches", scene, wrong)
        with pytest.raises(PatchFileError, match="not in the scene"):
            read_patches(tmp_path / "a.patches", scene, 64)


def test_a_file_that_cannot_be_finished_leaves_the_one_before(path, scene, patches, monkeypatch):
    """The disk fills up half-way through: the file of before is whole, and nothing else lies beside it."""
    before, write = path.read_bytes(), Path.write_bytes

    def fill_disk(file, data):
        write(file, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_bytes", fill_disk)
    with pytest.raises(PatchFileError, match="a.patches' cannot be written [(]No space left on device[)]"):
        write_patches(path, scene, patches.part(np.arange(10)))
    assert path.read_bytes() == before and list(path.parent.iterdir()) == [path]


def test_a_file_is_replaced_whole(path, scene, patches):
    write_patches(path, scene, patches.part(np.arange(10)))
    assert len(read_patches(path, scene, 64)) == 10 and list(path.parent.iterdir()) == [path]


def test_places_that_cannot_be_used(path, tmp_path, scene, patches):
    with pytest.raises(PatchFileError, match="cannot be written.*Choose another place"):
        write_patches(path / "a.patches", scene, patches)
    with pytest.raises(PatchFileError, match="cannot be read"):
        read_patches(tmp_path, scene, 64)
