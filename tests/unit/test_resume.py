"""Files of checkpoints: whole or none, within a limit, and written in little of a bake's time."""

import os

import numpy as np
import pytest

from engine.resume.array_file import read_arrays, write_arrays
from engine.resume.checkpoint import Checkpoints, WriteThrottle
from engine.resume.checkpoint_folder import CheckpointFolder

ARRAYS = {
    "odd": np.arange(7, dtype=np.uint8),
    "none": np.zeros((0, 3), np.float32),
    "strided": np.arange(24, dtype=np.float32).reshape(4, 6)[::2, 1::2],
    "number": np.array([np.inf]),
    "ä": np.array([[-1, 2**40]]),
}


def test_arrays_are_read_as_they_were_written(tmp_path):
    write_arrays(tmp_path / "file", ARRAYS)
    read = read_arrays(tmp_path / "file")
    assert list(read) == list(ARRAYS)
    for name, array in ARRAYS.items():
        assert np.array_equal(read[name], array) and read[name].dtype == array.dtype
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("kept", [0, 1, 15, 16, 23, 24, 60, -1])
def test_a_truncated_file_is_none(tmp_path, kept):
    write_arrays(tmp_path / "file", ARRAYS)
    content = (tmp_path / "file").read_bytes()
    (tmp_path / "file").write_bytes(content[:kept])
    assert read_arrays(tmp_path / "file") is None


def test_a_file_with_any_other_byte_is_none(tmp_path):
    write_arrays(tmp_path / "file", ARRAYS)
    content = (tmp_path / "file").read_bytes()
    for index in range(len(content)):
        damaged = bytearray(content)
        damaged[index] ^= 0x41
        (tmp_path / "file").write_bytes(damaged)
        assert read_arrays(tmp_path / "file") is None


def test_a_missing_file_and_a_folder_are_none(tmp_path):
    assert read_arrays(tmp_path / "file") is None
    assert read_arrays(tmp_path) is None


def test_the_oldest_checkpoint_gives_way(tmp_path):
    folder, block = CheckpointFolder(str(tmp_path), 5000), {"rows": np.zeros(1500, np.uint8)}
    for age, key in enumerate(("newest", "older", "oldest")):
        assert folder.write(key, "light", block)
        os.utime(tmp_path / "resume" / key, (1e9 - age, 1e9 - age))
    assert folder.write("another", "light", block)
    assert {path.name for path in (tmp_path / "resume").iterdir()} == {"another", "newest", "older"}


def test_a_checkpoint_never_grows_over_the_limit(tmp_path):
    folder, block = CheckpointFolder(str(tmp_path), 5000), {"rows": np.zeros(1500, np.uint8)}
    assert folder.write("other", "light", block)
    written = [folder.write("mine", f"rays-{first}-{first + 7}", block) for first in range(0, 70, 7)]
    assert written == [True] * 3 + [False] * 7
    assert {path.name for path in (tmp_path / "resume").iterdir()} == {"mine"}
    assert sum(path.stat().st_size for path in (tmp_path / "resume" / "mine").iterdir()) <= 5000


def test_checkpoints_of_one_bake_never_replace_each_other(tmp_path):
    rows, probes = {"rows": np.zeros(1500, np.uint8)}, {"light": np.zeros(1200, np.uint8)}
    assert Checkpoints(str(tmp_path), 5000).of(lambda: "older bake").write_rows("rays", 0, 7, rows)
    interrupted = Checkpoints(str(tmp_path), 5000)
    assert interrupted.of(lambda: "groups").write_rows("rays", 0, 7, rows)
    bake = Checkpoints(str(tmp_path), 5000)
    groups, patches = bake.of(lambda: "groups"), bake.of(lambda: "patches")
    assert [patches.write_probes(lambda: "light", number, probes) for number in range(4)] == [
        True, True, False, False,
    ]  # fmt: skip
    assert groups.rows_from_the_first("rays") == 7
    assert {path.name for path in (tmp_path / "resume").iterdir()} == {"groups", "patches"}


def test_a_folder_that_cannot_be_written_stops_nothing(tmp_path):
    (tmp_path / "resume").write_text("no folder")
    folder = CheckpointFolder(str(tmp_path), 5000)
    assert folder.empty and not folder.write("mine", "light", ARRAYS)
    folder.remove("mine")
    assert folder.files("mine") == []


@pytest.mark.parametrize(("cache", "limit"), [(False, 5000), (True, 0)])
def test_nothing_is_due_without_a_folder_or_space(tmp_path, cache, limit):
    checkpoints = Checkpoints(str(tmp_path) if cache else None, limit)
    assert not checkpoints.of(lambda: "key").due
    assert list(tmp_path.iterdir()) == []


def test_files_of_other_programs_are_left_alone_and_unread(tmp_path):
    (tmp_path / "resume" / "key").mkdir(parents=True)
    for name in ("rays-x-7", "rays-0", ".light.77", "notes.txt"):
        (tmp_path / "resume" / "key" / name).write_text("something")
    checkpoint = Checkpoints(str(tmp_path), 5000).of(lambda: "key")
    assert checkpoint.rows_from_the_first("rays") == 0
    assert checkpoint.rows("rays", 0, 7) is None and checkpoint.light(lambda: "light") is None


def test_writing_takes_a_tenth_of_the_time(monkeypatch):
    now = [100.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    clock, written = WriteThrottle(5), 0.0
    for _ in range(1000):
        now[0] += 0.25
        if clock.due:
            seconds = clock.room / 50e6
            now[0] += seconds
            clock.wrote(clock.room, now[0] - seconds)
            written += seconds
    assert 0.02 < written / (now[0] - 100) < 0.12


def test_nothing_is_written_before_the_interval(monkeypatch):
    now = [7.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    clock = WriteThrottle(5)
    now[0] = 11.9
    assert not clock.due
    now[0] = 12.1
    assert clock.due
