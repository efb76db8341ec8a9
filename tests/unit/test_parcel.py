"""Arrays that travel in files of this machine's memory."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from engine.cluster import parcel
from engine.cluster.parcel import MemoryFolder, Parcel, is_at_hand
from engine.errors import DeviceError

#: Larger than what travels as it is; sizes are prime.
LARGE = np.arange(3 * 30011, dtype=np.float32).reshape(30011, 3)


@pytest.fixture
def folder():
    made = MemoryFolder()
    yield made.path
    made.close()


@pytest.mark.parametrize("values", [
    LARGE,
    LARGE[::-1, 1],
    (LARGE / 8).astype(np.float16)[7:],
    np.zeros((0, 3), np.float32),
    np.array([np.nan, -0.0, np.inf], np.float32),
])  # fmt: skip
def test_what_arrives_is_what_was_sent(folder, values):
    for where in (folder, ""):
        sent = Parcel.of(values, where)
        arrived = pickle.loads(pickle.dumps(sent))
        rows = np.full(values.shape, 7, values.dtype)
        arrived.fill(rows)
        for found in (rows, arrived.open()):
            assert found.dtype == values.dtype
            assert found.tobytes() == np.ascontiguousarray(values).tobytes()
        assert sys.getsizeof(sent) >= values.nbytes
        sent.remove()
    assert not os.listdir(folder)


def test_only_large_arrays_are_in_files(folder):
    assert Parcel.of(LARGE, folder).values is None
    assert len(pickle.dumps(Parcel.of(LARGE, folder))) < 1000
    assert Parcel.of(LARGE[:5], folder).path == ""


def test_rows_are_filled_in_their_place(folder):
    rows = np.zeros((2 * len(LARGE), 3), np.float32)
    Parcel.of(LARGE, folder).fill(rows[5 : 5 + len(LARGE)])
    assert np.array_equal(rows[5 : 5 + len(LARGE)], LARGE) and not rows[:5].any()
    assert not rows[5 + len(LARGE) :].any()


def test_a_full_memory_lets_the_array_travel_as_it_is(monkeypatch, folder):
    def full(path, *_arguments, **_options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "ascontiguousarray", lambda values: _Unwritable(values, full))
    sent = Parcel.of(LARGE, folder)
    assert sent.path == "" and sent.values is LARGE
    assert not os.listdir(folder)


class _Unwritable:
    def __init__(self, values, write):
        self.values, self.tofile = values, write


def test_a_folder_that_is_gone_lets_the_array_travel_as_it_is(tmp_path):
    assert Parcel.of(LARGE, str(tmp_path / "gone")).values is LARGE


def test_a_file_that_is_gone_or_cut_off_is_an_error(folder):
    sent = Parcel.of(LARGE, folder)
    os.truncate(sent.path, 1001)
    with pytest.raises(DeviceError, match="cut off.*Bake again"):
        sent.open()
    sent.remove()
    sent.remove()
    with pytest.raises(DeviceError, match="cannot be read.*Bake again"):
        sent.open()


def test_the_folder_ends_with_what_is_in_it():
    made = MemoryFolder()
    assert is_at_hand(made.path)
    Parcel.of(LARGE, made.path)
    made.close()
    assert not Path(made.path).exists() and not is_at_hand(made.path)


def test_folders_of_killed_processes_are_removed(monkeypatch, tmp_path):
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    orphan, other, own = (
        tmp_path / name for name in (f"hemibake-{ended.pid}-x", "hemibake-notes", f"hemibake-{os.getpid()}-y")
    )
    for found in (orphan, other, own):
        found.mkdir()
    monkeypatch.setattr(parcel, "_MEMORY", tmp_path)
    MemoryFolder()
    assert not orphan.exists() and other.exists() and own.exists()
