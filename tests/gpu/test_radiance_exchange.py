"""Memory in which the light of sweeps goes to workers of the same machine and comes back."""

import errno
import os
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine import Settings
from engine.cluster import memory_folder as folders
from engine.cluster.memory_folder import is_at_hand, memory_folder
from engine.cluster.patch_rows import PatchRows, unpacked
from engine.cluster.patch_table import SparseRadiance
from engine.cluster.radiance_exchange import RadianceExchange, write_rows
from engine.cluster.scene_payload import ScenePayload
from engine.cluster.stored_array import StoredArray
from engine.gather.half_radiance import HalfRadiance
from engine.numpy_pickle import portable_bytes
from engine.patches.patch_list import PatchList
from engine.scene.model import Texture
from tests.analytic.scenes import nine_quad_room
from tests.transparency import transparent

pytestmark = pytest.mark.skipif(not Path("/dev/shm").exists(), reason="There are files in memory on Linux.")

#: Prime, and larger than a page.
COUNT = 10007


def full(*_):
    """Stand for a machine whose memory is full."""
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.fixture
def folder():
    with memory_folder() as made:
        yield made


def test_light_arrives_as_it_was_sent_in_every_sweep(folder):
    memory, random = RadianceExchange(folder, COUNT), np.random.default_rng(3)
    for unit in (1e-30, 1.0, 7e11):
        parts = random.uniform(0, 65504, (COUNT, 3)).astype(np.float16)
        parts[0], parts[-1] = 0, 65504
        sent = memory.put(HalfRadiance(parts, np.float32(unit)))
        arrived = pickle.loads(pickle.dumps(sent)).opened()
        assert len(pickle.dumps(sent)) < 1000
        assert arrived.parts.tobytes() == parts.tobytes() and arrived.unit == np.float32(unit)


def test_light_that_is_written_over_is_another(folder):
    """Workers take the light of a sweep to their device once, and know it by this."""
    memory, light = (
        RadianceExchange(folder, COUNT),
        HalfRadiance(np.ones((COUNT, 3), np.float16), np.float32(1)),
    )
    first, second = (pickle.loads(pickle.dumps(memory.put(light))) for _ in range(2))
    assert first != second and first == pickle.loads(pickle.dumps(first))


def test_rows_lie_where_they_belong(folder):
    memory = RadianceExchange(folder, COUNT)
    wanted = np.random.default_rng(5).normal(size=(COUNT, 3)).astype(np.float32)
    wanted[17] = np.nan
    for first, last in ((5003, COUNT), (0, 1), (1, 5003)):
        write_rows(memory.path, first, wanted[first:last], COUNT)
    assert memory.rows.tobytes() == wanted.tobytes()


def test_who_still_writes_to_memory_that_was_closed_disturbs_nobody(folder):
    closed = RadianceExchange(folder, COUNT)
    write_rows(closed.path, 0, np.ones((1, 3), np.float32), COUNT)
    closed.close()
    closed.close()
    other = RadianceExchange(folder, COUNT)
    write_rows(closed.path, 0, np.full((COUNT, 3), 7, np.float32), COUNT)
    assert not other.rows.any()


def test_no_room_is_an_error_that_leaves_nothing(folder, monkeypatch):
    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(OSError, match="No space left"):
        RadianceExchange(folder, COUNT)
    assert not os.listdir(folder)


def test_the_folder_ends_with_what_is_in_it():
    with memory_folder() as folder:
        assert is_at_hand(folder)
        RadianceExchange(folder, COUNT)
    assert not Path(folder).exists() and not is_at_hand(folder)


def test_without_files_in_memory_there_is_no_folder(monkeypatch, tmp_path):
    monkeypatch.setattr(folders, "_MEMORY", tmp_path / "none")
    with memory_folder() as folder:
        assert folder == ""


def test_folders_of_killed_processes_are_removed(monkeypatch, tmp_path):
    """Not those of a container that has the same memory: its processes have other numbers."""
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    here = folders._namespace()
    orphan, *others = (
        tmp_path / f"hemibake-{name}"
        for name in (
            f"{ended.pid}-{here}-x",
            "notes",
            f"{os.getpid()}-{here}-y",
            f"{ended.pid}-{here + 1}-z",
            f"99999999999-{here}-v",
        )
    )
    for found in (orphan, *others):
        found.mkdir()
    monkeypatch.setattr(folders, "_MEMORY", tmp_path)
    with memory_folder():
        assert not orphan.exists() and all(other.exists() for other in others)


def test_a_scene_travels_in_a_file_where_there_is_room(folder, monkeypatch):
    scene, settings = nine_quad_room(), Settings(resolution=31)
    in_file = ScenePayload.of(scene, settings, True, folder)
    monkeypatch.setattr(os, "posix_fallocate", full)
    inside = ScenePayload.of(scene, settings, True, folder)
    assert len(pickle.dumps(in_file)) < 1000 < len(inside.data) and not inside.path
    assert in_file.digest == inside.digest == ScenePayload.of(scene, settings, False).digest
    for shipment in (in_file, inside):
        arrived, told = pickle.loads(pickle.dumps(shipment)).unpacked()
        assert told == settings and arrived.atlases == scene.atlases
        assert arrived.meshes[0].positions.tobytes() == scene.meshes[0].positions.tobytes()


def test_textures_travel_only_where_light_passes_through_them():
    room, pixels = nine_quad_room(), np.linspace(0, 1, 127 * 61, dtype=np.float32).reshape(127, 61, 1)
    look, holes = Texture("Look", np.repeat(pixels, 3, axis=2), "Look"), Texture("Holes", pixels, "Holes")
    uvs = dict.fromkeys(("Look", "Holes"), room.meshes[0].uvs)
    materials = (
        replace(
            room.materials[0], reflectance_map=look, emission_map=look, transmission=transparent(1.0, holes)
        ),
    )
    meshes = (replace(room.meshes[0], texture_uvs=uvs), *room.meshes[1:])
    scene = replace(room, meshes=meshes, materials=(*materials, *room.materials[1:]))
    arrived, _ = ScenePayload.of(scene, Settings(), False).unpacked()
    material = arrived.materials[0]
    assert material.reflectance_map is None and material.emission_map is None
    assert np.array_equal(material.transmission.bounce.texture.pixels, holes.pixels)
    assert arrived.meshes[0].texture_uvs.keys() == {"Holes"}
    assert np.array_equal(material.reflectance, room.materials[0].reflectance)


@pytest.mark.parametrize("kind", [np.uint32, np.float32, np.int32])
def test_arrays_travel_in_files_where_there_is_room(folder, monkeypatch, kind):
    """Rows of 12 bytes begin at no multiple of a page."""
    array = np.arange(2 * 3 * COUNT, dtype=kind)[::2].reshape(COUNT, 3)
    in_file = StoredArray.of(array, folder)
    monkeypatch.setattr(os, "posix_fallocate", full)
    inside = StoredArray.of(array, folder)
    assert len(pickle.dumps(in_file)) < 1000 < len(pickle.dumps(inside))
    for stored in (in_file, inside):
        arrived = pickle.loads(pickle.dumps(stored))
        assert arrived.opened().dtype == kind and np.array_equal(arrived.opened(), array)
        some = pickle.loads(pickle.dumps(arrived.rows(3001, 10006)))
        assert np.array_equal(some.opened(), array[3001:10006])
        assert np.array_equal(some.rows(5, 11).opened(), array[3006:3012])


def test_no_rows_are_no_file(folder):
    nothing = StoredArray.of(np.zeros((0, 3), np.float32), folder)
    assert not nothing.path and nothing.opened().shape == (0, 3)


@pytest.mark.parametrize("in_files", [True, False])
def test_a_block_gets_its_rows_alone(folder, in_files):
    numbers = np.arange(COUNT, dtype=np.int32)
    patches = PatchList(101, numbers, numbers * 3, numbers // 7, np.eye(3, dtype=np.float32)[numbers % 3])
    rows = PatchRows.of(patches, folder if in_files else "").part(5003, 5017)
    assert rows.in_files == in_files
    arrived = unpacked(portable_bytes(rows) if in_files else pickle.loads(pickle.dumps(rows)))
    assert arrived.first == 5003
    for name in ("texel", "triangle", "barycentric"):
        assert np.array_equal(getattr(arrived, name).opened(), getattr(patches, name)[5003:5017])


def test_radiance_of_few_patches_arrives_as_that_of_all():
    radiance = np.zeros((COUNT, 3), np.float32)
    radiance[[0, 17, COUNT - 1]] = [(1, 0, 0), (0, 0, 2), (0, np.inf, 3)]
    glow = SparseRadiance.of(radiance)
    assert np.array_equal(glow.patch, [0, 17, COUNT - 1])
    assert np.array_equal(pickle.loads(pickle.dumps(glow)).of_all(), radiance)
    assert SparseRadiance.of(radiance[:0]).of_all().shape == (0, 3)
