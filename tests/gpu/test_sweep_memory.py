"""Memory in which the light of sweeps goes to workers of the same machine and comes back."""

import errno
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from engine import Settings
from engine.cluster import memory_folder as folders
from engine.cluster.memory_folder import is_at_hand, memory_folder
from engine.cluster.shipment import Shipment
from engine.cluster.squares import Squares
from engine.cluster.sweep_memory import SweepMemory, write_rows
from engine.gather.half_light import HalfLight
from tests.analytic.scenes import nine_quad_room

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
    memory, random = SweepMemory(folder, COUNT), np.random.default_rng(3)
    for unit in (1e-30, 1.0, 7e11):
        parts = random.uniform(0, 65504, (COUNT, 3)).astype(np.float16)
        parts[0], parts[-1] = 0, 65504
        sent = memory.put(HalfLight(parts, np.float32(unit)))
        arrived = pickle.loads(pickle.dumps(sent)).opened()
        assert len(pickle.dumps(sent)) < 1000
        assert arrived.parts.tobytes() == parts.tobytes() and arrived.unit == np.float32(unit)


def test_light_that_is_written_over_is_another(folder):
    """Workers take the light of a sweep to their device once, and know it by this."""
    memory, light = SweepMemory(folder, COUNT), HalfLight(np.ones((COUNT, 3), np.float16), np.float32(1))
    first, second = (pickle.loads(pickle.dumps(memory.put(light))) for _ in range(2))
    assert first != second and first == pickle.loads(pickle.dumps(first))


def test_rows_lie_where_they_belong(folder):
    memory = SweepMemory(folder, COUNT)
    wanted = np.random.default_rng(5).normal(size=(COUNT, 3)).astype(np.float32)
    wanted[17] = np.nan
    for first, last in ((5003, COUNT), (0, 1), (1, 5003)):
        write_rows(memory.path, first, wanted[first:last], COUNT)
    assert memory.rows.tobytes() == wanted.tobytes()


def test_who_still_writes_to_memory_that_was_closed_disturbs_nobody(folder):
    closed = SweepMemory(folder, COUNT)
    write_rows(closed.path, 0, np.ones((1, 3), np.float32), COUNT)
    closed.close()
    closed.close()
    other = SweepMemory(folder, COUNT)
    write_rows(closed.path, 0, np.full((COUNT, 3), 7, np.float32), COUNT)
    assert not other.rows.any()


def test_no_room_is_an_error_that_leaves_nothing(folder, monkeypatch):
    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(OSError, match="No space left"):
        SweepMemory(folder, COUNT)
    assert not os.listdir(folder)


def test_the_folder_ends_with_what_is_in_it():
    with memory_folder() as folder:
        assert is_at_hand(folder)
        SweepMemory(folder, COUNT)
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
    in_file = Shipment.of(scene, settings, True, folder)
    monkeypatch.setattr(os, "posix_fallocate", full)
    inside = Shipment.of(scene, settings, True, folder)
    assert len(pickle.dumps(in_file)) < 1000 < len(inside.data) and not inside.path
    assert in_file.digest == inside.digest == Shipment.of(scene, settings, False).digest
    for shipment in (in_file, inside):
        arrived, told = pickle.loads(pickle.dumps(shipment)).unpacked()
        assert told == settings and arrived.atlases == scene.atlases
        assert arrived.meshes[0].positions.tobytes() == scene.meshes[0].positions.tobytes()


def test_squares_travel_in_a_file_where_there_is_room(folder, monkeypatch):
    leader = np.arange(2 * COUNT, dtype=np.uint32)[::2] // 16 * 16
    in_file = Squares.of(leader, 4, folder)
    monkeypatch.setattr(os, "posix_fallocate", full)
    inside = Squares.of(leader, 4, folder)
    assert len(pickle.dumps(in_file)) < 1000 < len(pickle.dumps(inside))
    assert in_file.digest == inside.digest != Squares.of(leader[::-1], 4, "").digest
    for squares in (in_file, inside):
        arrived = pickle.loads(pickle.dumps(squares))
        assert np.array_equal(arrived.leader, leader) and arrived.leader.dtype == np.uint32
