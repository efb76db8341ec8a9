import errno
import os
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine.errors import PatchFileError
from engine.patches.patch_file import read_patches, write_patches
from tests.analytic.scenes import furnace, quads, rectangle
from tests.reference.cpu_patches import list_patches

SIZE = 61
HEADER = 32
COLUMNS = ("atlas", "texel", "mesh", "face", "subface")


@pytest.fixture
def scene():
    """Two meshes in one atlas, one without faces, one with polygons of one and two triangles in another."""
    room = furnace(0.5, 1.0)
    other = replace(room.meshes[0].subset(np.arange(12) != 3), atlas=1)
    strip = quads(rectangle((0, 0, 2), (7, 0, 0), (0, 5, 0))[None], [(1, 23, 7, 5)], [0], 32, "Strip")
    nothing = other.subset(np.zeros(11, bool))
    return replace(room, meshes=(*room.meshes, nothing, other, strip), atlases=("Room", "Other"))


@pytest.fixture
def patches(scene):
    return list_patches(scene, SIZE)


@pytest.fixture
def path(tmp_path, scene, patches):
    write_patches(tmp_path / "a.patches", scene, patches)
    return tmp_path / "a.patches"


def column(body, name):
    """Return a view of an array in the body of a file: (n,) int32, or (n, 3) float32 barycentrics."""
    count = len(body) // 8
    if name == "barycentric":
        return body[5 * count :].view(np.float32).reshape(count, 3)
    start = COLUMNS.index(name) * count
    return body[start : start + count]


def body_of(path):
    """Return the data after the header of a file, (8 n,) int32."""
    return np.frombuffer(path.read_bytes()[HEADER:], np.int32).copy()


def write_body(path, body):
    """Replace the data after the header, and its checksum."""
    header = path.read_bytes()[: HEADER - 4]
    path.write_bytes(header + zlib.crc32(body.tobytes()).to_bytes(4, "little") + body.tobytes())


def test_round_trip_keeps_every_bit(path, scene, patches):
    loaded = read_patches(path, scene, SIZE)
    assert loaded.resolution == SIZE
    for name in ("atlas", "texel", "triangle", "barycentric"):
        before, after = getattr(patches, name), getattr(loaded, name)
        assert before.dtype == after.dtype and (before == after).all()


def test_the_file_holds_mesh_face_and_subface_of_each_patch(path, scene, patches):
    body, first = body_of(path), np.cumsum([0, *(len(mesh.face) for mesh in scene.meshes)])
    assert set(column(body, "mesh")) == {0, 2, 3}
    for mesh, face, subface, triangle in zip(
        *(column(body, name) for name in COLUMNS[2:]), patches.triangle, strict=True
    ):
        local = triangle - first[mesh]
        assert (scene.meshes[mesh].face[local], scene.meshes[mesh].subface[local]) == (face, subface)
    assert (column(body, "barycentric") == patches.barycentric).all()


@pytest.mark.parametrize("length", [9, 20, 32, 200])
def test_truncated_file(path, scene, length):
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(PatchFileError, match="a.patches.*(header|truncated)"):
        read_patches(path, scene, SIZE)


def test_foreign_file(tmp_path, scene):
    path = tmp_path / "a.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    with pytest.raises(PatchFileError, match="not a Hemibake patch file"):
        read_patches(path, scene, SIZE)


def test_damaged_body_and_other_version(path, scene):
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    with pytest.raises(PatchFileError, match="checksum"):
        read_patches(path, scene, SIZE)
    data[8] = 99
    path.write_bytes(data)
    with pytest.raises(PatchFileError, match="version 99"):
        read_patches(path, scene, SIZE)


def test_another_resolution_or_other_charts(path, scene):
    with pytest.raises(PatchFileError, match="made for 61 x 61"):
        read_patches(path, scene, 67)
    moved = replace(scene.meshes[0], uvs=scene.meshes[0].uvs * np.float32(0.5))
    with pytest.raises(PatchFileError, match="UVs have changed"):
        read_patches(path, replace(scene, meshes=(moved,)), SIZE)


@pytest.mark.parametrize(
    ("name", "index", "value"),
    [("atlas", 0, -1), ("atlas", -1, 2), ("atlas", 0, 1), ("texel", 0, -1), ("texel", -1, SIZE**2),
     ("texel", -1, 2**31 - 1), ("texel", 7, 0), ("mesh", 5, -1), ("mesh", 5, 4), ("mesh", 5, 2**31 - 1),
     ("mesh", 5, 1), ("mesh", 5, 2), ("face", 9, -1), ("face", 9, 6), ("face", 9, 2**31 - 1),
     ("subface", 3, -1), ("subface", 3, 2), ("subface", 3, 2**31 - 1), ("barycentric", 4, np.nan),
     ("barycentric", 4, np.inf), ("barycentric", 4, -0.5), ("barycentric", 4, 0.9)],
)  # fmt: skip
def test_wrong_contents_with_right_checksums(path, scene, name, index, value):
    body = body_of(path)
    column(body, name)[index] = value
    write_body(path, body)
    with pytest.raises(PatchFileError, match="a.patches' has patches that are not in the scene.*[.] Delete"):
        read_patches(path, scene, SIZE)


def test_a_triangle_that_is_missing(path, scene):
    """Polygon 1 of the third mesh has only its first triangle."""
    body = body_of(path)
    chosen = np.flatnonzero((column(body, "mesh") == 2) & (column(body, "face") == 1))
    column(body, "subface")[chosen[-1]] = 1
    write_body(path, body)
    with pytest.raises(PatchFileError, match="not in the scene"):
        read_patches(path, scene, SIZE)


def test_no_patches_at_all(path, scene, patches):
    write_patches(path, scene, patches.subset(np.zeros(len(patches), bool)))
    with pytest.raises(PatchFileError, match="not in the scene"):
        read_patches(path, scene, SIZE)


def test_a_file_that_cannot_be_finished_leaves_the_one_before(path, scene, patches, monkeypatch):
    """The disk fills up half-way through: the file of before is whole, and nothing else lies beside it."""
    before, write = path.read_bytes(), Path.write_bytes

    def fill_disk(file, data):
        write(file, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_bytes", fill_disk)
    with pytest.raises(PatchFileError, match="a.patches' cannot be written [(]No space left on device[)]"):
        write_patches(path, scene, patches.subset(np.arange(10)))
    assert path.read_bytes() == before and list(path.parent.iterdir()) == [path]


def test_a_file_is_replaced_whole(path, scene, patches):
    write_patches(path, scene, patches.subset(np.arange(10)))
    assert len(read_patches(path, scene, SIZE)) == 10 and list(path.parent.iterdir()) == [path]


def test_paths_that_cannot_be_used(path, tmp_path, scene, patches):
    with pytest.raises(PatchFileError, match="cannot be written.*Choose another path"):
        write_patches(path / "a.patches", scene, patches)
    with pytest.raises(PatchFileError, match="cannot be read"):
        read_patches(tmp_path, scene, SIZE)
