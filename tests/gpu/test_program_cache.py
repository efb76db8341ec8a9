"""Programs are built once for a device, and whatever is in their files, kernels work."""

import os

import numpy as np
import pyopencl as cl
import pytest

from engine import Settings, finished
from engine.device import program_cache
from engine.device.compute import Compute
from engine.device.program_cache import ProgramCache
from engine.session import Session
from tests.analytic.scenes import furnace

SOURCE = "__kernel void fill(__global float *x) { x[get_global_id(0)] = VALUE; }"


@pytest.fixture(scope="module")
def context():
    return Compute().context


@pytest.fixture
def built(monkeypatch):
    """Count what is built from source."""
    sources, build = [], program_cache.build

    def counted(context, source, options=()):
        sources.append(source)
        return build(context, source, options)

    monkeypatch.setattr(program_cache, "build", counted)
    return sources


def filled(context, program):
    """Return what the kernel writes."""
    queue = cl.CommandQueue(context)
    buffer, values = cl.Buffer(context, cl.mem_flags.READ_WRITE, 4), np.zeros(1, np.float32)
    cl.Kernel(program, "fill")(queue, (1,), None, buffer)
    cl.enqueue_copy(queue, values, buffer)
    return float(values[0])


def files(folder):
    return [path for path in folder.rglob("*") if path.is_file()]


def test_a_later_process_builds_nothing(context, built, tmp_path):
    for expected in (1, 1, 1):
        cache = ProgramCache(context, str(tmp_path))
        assert filled(context, cache.build(SOURCE, ("-DVALUE=3.5f",))) == 3.5
        assert len(built) == expected
    assert len(files(tmp_path)) == 1


def test_other_options_and_other_source_are_other_programs(context, built, tmp_path):
    for _ in range(2):
        cache = ProgramCache(context, str(tmp_path))
        assert filled(context, cache.build(SOURCE, ("-DVALUE=1.0f",))) == 1
        assert filled(context, cache.build(SOURCE, ("-DVALUE=2.0f",))) == 2
        assert filled(context, cache.build(SOURCE.replace("VALUE", "7.0f"))) == 7
    assert len(built) == 3


@pytest.mark.parametrize("content", [b"", b"no program", 100, -1], ids=["empty", "other", "begun", "cut"])
def test_a_damaged_file_is_built_again(context, built, tmp_path, content):
    ProgramCache(context, str(tmp_path)).build(SOURCE, ("-DVALUE=3.5f",))
    (path,) = files(tmp_path)
    path.write_bytes(content if isinstance(content, bytes) else path.read_bytes()[:content])
    for expected in (2, 2):
        assert filled(context, ProgramCache(context, str(tmp_path)).build(SOURCE, ("-DVALUE=3.5f",))) == 3.5
        assert len(built) == expected


def test_programs_that_nobody_uses_any_more_are_removed(context, tmp_path, monkeypatch):
    monkeypatch.setattr(program_cache, "_MOST", 2)
    for index, value in enumerate((1, 2, 3)):
        ProgramCache(context, str(tmp_path)).build(SOURCE, (f"-DVALUE={value}.0f",))
        newest = max(files(tmp_path), key=lambda path: path.stat().st_mtime_ns)
        os.utime(newest, (1000 + index, 1000 + index))
    ProgramCache(context, str(tmp_path))
    assert len(files(tmp_path)) == 2


def test_a_folder_that_cannot_be_written_or_is_none_stops_nothing(context, tmp_path):
    (tmp_path / "file").write_text("")
    for folder in (None, str(tmp_path / "file")):
        assert filled(context, ProgramCache(context, folder).build(SOURCE, ("-DVALUE=3.5f",))) == 3.5


def test_pocl_is_not_asked_for_programs_that_it_keeps_itself(context, tmp_path):
    """It would build all their kernels once more: a first bake took 46 s of a processor instead of 18."""
    if context.devices[0].platform.name != "Portable Computing Language":
        pytest.skip("another driver")
    Compute(str(tmp_path)).kernels("widen.cl", "widen")
    assert not files(tmp_path)


def test_a_bake_with_programs_of_an_earlier_session_gives_the_same_bits(built, tmp_path, monkeypatch):
    monkeypatch.setattr(Compute, "_is_pocl", False)
    settings = Settings(resolution=32, hemicube=8, visibility="rays", cache_dir=str(tmp_path))
    images = []
    for _ in range(2):
        session = Session()
        images.append(finished(session.bake(furnace(0.5, 1.0), settings)).image)
        session.close()
        if len(images) == 1:
            assert len(built) > 5
            built.clear()
    assert np.array_equal(*images) and len(built) <= 1  # the probe of the device
