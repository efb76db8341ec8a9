"""Programs are built once for a device, and whatever is in their files, kernels work."""

import itertools
import os
import sys
import time

import numpy as np
import pyopencl as cl
import pytest

from engine import Settings, finished
from engine.device import builders, cl_device, program_cache
from engine.device.builders import Program
from engine.device.cl_device import ComputeDevice
from engine.device.planned_program import Launch, PlannedProgram
from engine.device.program_cache import ProgramCache, file_name, marks_folder, program_name
from engine.errors import DeviceError
from engine.plan.common_programs import _listed
from engine.session import Session
from engine.visibility.rays.ray_tracer import cutout_options
from tests.analytic.scenes import furnace
from tests.gpu.graphics_card import GraphicsCard

SOURCE = "__kernel void fill(__global float *x) { x[get_global_id(0)] = VALUE; }"


@pytest.fixture(scope="module")
def context():
    return ComputeDevice().context


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


def opened(context, folder):
    cache = ProgramCache(context.devices[0], folder)
    cache.open(context)
    return cache


def files(folder):
    """Return the files in a folder, except the record of the device in use."""
    return [path for path in folder.rglob("*") if path.is_file() and not path.match("device_of_*")]


def test_a_later_process_builds_nothing(context, built, tmp_path):
    for expected in (1, 1, 1):
        cache = opened(context, str(tmp_path))
        assert filled(context, cache.build(SOURCE, ("-DVALUE=3.5f",))) == 3.5
        assert len(built) == expected
    assert len(files(tmp_path)) == 1


def test_other_options_and_other_source_are_other_programs(context, built, tmp_path):
    for _ in range(2):
        cache = opened(context, str(tmp_path))
        assert filled(context, cache.build(SOURCE, ("-DVALUE=1.0f",))) == 1
        assert filled(context, cache.build(SOURCE, ("-DVALUE=2.0f",))) == 2
        assert filled(context, cache.build(SOURCE.replace("VALUE", "7.0f"))) == 7
    assert len(built) == 3


@pytest.mark.parametrize("content", [b"", b"no program", 100, -1], ids=["empty", "other", "begun", "cut"])
def test_a_damaged_file_is_built_again(context, built, tmp_path, content):
    opened(context, str(tmp_path)).build(SOURCE, ("-DVALUE=3.5f",))
    (path,) = files(tmp_path)
    path.write_bytes(content if isinstance(content, bytes) else path.read_bytes()[:content])
    for expected in (2, 2):
        assert filled(context, opened(context, str(tmp_path)).build(SOURCE, ("-DVALUE=3.5f",))) == 3.5
        assert len(built) == expected


def test_programs_that_nobody_uses_any_more_are_removed(context, tmp_path, monkeypatch):
    monkeypatch.setattr(program_cache, "_MOST", 2)
    for index, value in enumerate((1, 2, 3)):
        opened(context, str(tmp_path)).build(SOURCE, (f"-DVALUE={value}.0f",))
        newest = max(files(tmp_path), key=lambda path: path.stat().st_mtime_ns)
        os.utime(newest, (1000 + index, 1000 + index))
    opened(context, str(tmp_path))
    assert len(files(tmp_path)) == 2


def test_a_folder_that_cannot_be_written_or_is_none_stops_nothing(context, tmp_path):
    (tmp_path / "file").write_text("")
    for folder in (None, str(tmp_path / "file")):
        assert filled(context, opened(context, folder).build(SOURCE, ("-DVALUE=3.5f",))) == 3.5


BROKEN = "nothing that is a program"


@pytest.fixture
def many(monkeypatch):
    """Have two processes, whatever the machine, and leave one program to this one."""
    monkeypatch.setattr(program_cache, "_MIN_GPU", 4)
    monkeypatch.setattr(program_cache, "_OWN", 1)
    monkeypatch.setattr(builders, "_processes", lambda device: 2)


def test_other_processes_build_ahead_what_is_asked_for(context, built, many, tmp_path):
    """But for the first program, which is left to this process, and one that nobody can build."""
    wanted = [Program(SOURCE, (f"-DVALUE={value}.0f",)) for value in range(1, 8)]
    cache = opened(context, str(tmp_path))
    cache.begin([*wanted, Program(BROKEN, ())])
    cache.begin(wanted)
    assert filled(context, cache.build(SOURCE, ("-DVALUE=9.0f",))) == 9
    for value, program in enumerate(wanted, 1):
        assert filled(context, cache.build(*program[:2])) == value
    with pytest.raises(cl.Error):
        cache.build(BROKEN)
    assert built == [SOURCE, SOURCE, BROKEN] and len(files(tmp_path)) == 8

    # A later process finds all of them.
    later = opened(context, str(tmp_path))
    later.begin(wanted)
    assert filled(context, later.build(*wanted[4][:2])) == 5 and len(built) == 3


def test_processes_start_before_the_context_of_a_card_is_made(many, tmp_path, monkeypatch):
    order, make, start = [], GraphicsCard._first_working_context, builders.Builders._start
    monkeypatch.setattr(GraphicsCard, "_is_pocl", False)
    monkeypatch.setattr(
        GraphicsCard, "_first_working_context", lambda *found: order.append("context") or make(*found)
    )
    monkeypatch.setattr(builders.Builders, "_start", lambda *share: order.append("process") or start(*share))
    wanted = [PlannedProgram(("float4_rows.cl",), (f"-DVALUE={value}",)) for value in range(1, 8)]
    card = GraphicsCard(str(tmp_path), ahead=wanted)
    assert order == ["process", "process", "context"]
    card.kernels("float4_rows.cl", "to_float4", options=wanted[6][1])
    card.release()


@pytest.mark.parametrize("failures", [1, 2])
def test_a_card_that_refuses_a_context_is_asked_again_without_processes(
    many, tmp_path, monkeypatch, failures
):
    """They may have what it lacks; they do not outlive a device that does not open."""
    started, begin, asked, devices = [], builders.Builders.__init__, [], ComputeDevice().context.devices

    def begun(self, *arguments):
        started.append(self)
        begin(self, *arguments)

    def context_of(device):
        asked.append([process.poll() for each in started for process in each._processes])
        if len(asked) <= failures:
            raise cl.Error("out of memory")
        return cl.Context([device])

    monkeypatch.setattr(GraphicsCard, "_is_pocl", False)
    monkeypatch.setattr(builders.Builders, "__init__", begun)
    monkeypatch.setattr("engine.device.cl_device.found_devices", lambda: devices)
    wanted = [PlannedProgram(("float4_rows.cl",), (f"-DVALUE={value}",)) for value in range(1, 8)]
    if failures == 1:
        GraphicsCard(str(tmp_path), context_of=context_of, ahead=wanted).release()
    else:
        with pytest.raises(DeviceError, match="out of memory"):
            GraphicsCard(str(tmp_path), context_of=context_of, ahead=wanted)
    assert len(asked[0]) == 2 and None not in asked[1]


def test_processes_that_die_or_cannot_start_stop_nothing(context, built, many, tmp_path, monkeypatch):
    wanted = [Program(SOURCE, (f"-DVALUE={value}.0f",)) for value in range(1, 8)]
    cache = opened(context, str(tmp_path / "killed"))
    cache.begin(wanted)
    cache.stop()
    assert filled(context, cache.build(*wanted[6][:2])) == 7
    monkeypatch.setattr(sys, "executable", str(tmp_path / "nothing"))
    cache = opened(context, str(tmp_path / "not started"))
    cache.begin(wanted)
    assert filled(context, cache.build(*wanted[6][:2])) == 7
    assert 1 <= len(built) <= 2


def test_few_programs_and_those_without_a_folder_are_built_here(context, many, monkeypatch, tmp_path):
    monkeypatch.setattr(builders, "_processes", lambda device: pytest.fail("processes"))
    opened(context, None).begin([Program(SOURCE, (f"-DVALUE={value}.0f",)) for value in range(9)])
    opened(context, str(tmp_path)).begin([Program(SOURCE, (f"-DVALUE={value}.0f",)) for value in range(3)])


@pytest.mark.parametrize("count", [1, 2, 3, 50])
def test_shares_hold_each_program_once_and_take_about_as_long(count):
    lengths = np.random.default_rng(3).integers(100, 90_000, 29)
    programs = {f"p{number}": Program("x" * length, ()) for number, length in enumerate(lengths)}
    shares = builders._shares(programs, count)
    order = list(programs)
    assert sorted(itertools.chain(*shares), key=order.index) == order and len(shares) == min(count, 29)
    assert all(share == sorted(share, key=order.index) for share in shares)
    if count <= 3:
        seconds = [sum(0.2 + (len(programs[name][0]) / 60_000) ** 2 for name in share) for share in shares]
        assert max(seconds) - min(seconds) < 1
    assert builders._shares(programs, 0) == []


def test_pocl_is_not_asked_for_programs_that_it_keeps_itself(context, tmp_path):
    """It would build all their kernels once more: a first bake took 46 s of a processor instead of 18."""
    if context.devices[0].platform.name != "Portable Computing Language":
        pytest.skip("another driver")
    ComputeDevice(str(tmp_path)).kernels("float4_rows.cl", "to_float4")
    assert not files(tmp_path)


def test_other_processes_compile_what_pocl_keeps(context, many, tmp_path):
    """They launch kernels, and leave an empty file of each program; later processes begin none."""
    launch = Launch("fill", (64,), ("b",))
    wanted = [Program(SOURCE, (f"-DVALUE={value}.25f",), (launch,)) for value in range(5)]
    names = {program_name(*program[:2]) for program in wanted}
    cache = ProgramCache(context.devices[0], str(tmp_path), keeps_itself=True)
    cache.open(context)
    assert cache.begin(wanted) == set()
    left = cache.preparation(names)
    assert left is None or (0 <= left.done < left.total == 5 and left.seconds_left > 0)
    for value, program in enumerate(wanted):
        assert filled(context, cache.build(*program[:2])) == value + 0.25
    assert cache.preparation(names) is None
    cache.keep_pace()
    kept = {path.name: path.stat().st_size for path in files(tmp_path)}
    assert kept.pop("build_paces.json") and kept == dict.fromkeys(map(file_name, wanted), 0)
    later = ProgramCache(context.devices[0], str(tmp_path), keeps_itself=True)
    later.begin(wanted)
    assert later.preparation(names) is None and not later._builders


def test_programs_with_other_launches_are_built_ahead_again(context, many, tmp_path, monkeypatch):
    """A new version lists more launches of a program whose source stays; PoCL lacks their kernels."""
    asked = []

    class Built:
        def __init__(self, device, programs, built, pace):
            asked.append(list(programs))
            for name in programs:
                built(name, b"")

        def binary(self, name):
            return b""

    def begin(launches):
        cache = ProgramCache(context.devices[0], str(tmp_path), keeps_itself=True)
        cache.open(context)
        cache.begin([Program(SOURCE, (f"-DVALUE={value}.75f",), launches) for value in range(5)])
        return cache

    monkeypatch.setattr(program_cache, "Builders", Built)
    small, large = (Launch("fill", (64,), ("b",), has_many) for has_many in (False, True))
    for launches in ((small,), (small,), (small, large), (small,), (small, large)):
        cache = begin(launches)
        cache.begin([Program(SOURCE, (f"-DVALUE={value}.75f",), launches) for value in range(5)])
    assert len(asked) == 2 and asked[0] == asked[1] and len(files(tmp_path)) == 10
    assert filled(context, cache.build(SOURCE, ("-DVALUE=3.75f",))) == 3.75
    assert len(files(tmp_path)) == 10


@pytest.mark.skipif(sys.platform == "win32", reason="marks lie in the folder of the settings")
@pytest.mark.parametrize(
    ("environment", "folder"),
    [
        ({"HOME": "/home/a"}, "/home/a/.cache/pocl/kcache/hemibake"),
        ({"HOME": "/home/a", "XDG_CACHE_HOME": ""}, "/home/a/.cache/pocl/kcache/hemibake"),
        ({"HOME": "/home/a", "XDG_CACHE_HOME": "/b"}, "/b/pocl/kcache/hemibake"),
        ({"XDG_CACHE_HOME": "/b", "POCL_CACHE_DIR": "/c"}, "/c/hemibake"),
        ({}, "/tmp/pocl/kcache/hemibake"),
    ],
)
def test_marks_of_kernels_lie_in_the_cache_of_pocl(monkeypatch, environment, folder):
    """A new folder of settings, as of another Blender, finds the kernels that PoCL already has."""
    for name in ("HOME", "XDG_CACHE_HOME", "POCL_CACHE_DIR"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert marks_folder("/settings") == folder and marks_folder(None) is None


@pytest.mark.parametrize("tinted", [False, True])
def test_every_listed_kernel_ends_when_it_is_launched_with_zeros(tmp_path, monkeypatch, tinted):
    """A process that hangs or crashes would leave the other programs to the bake."""
    monkeypatch.setattr(cl_device, "marks_folder", lambda folder: folder)
    device = ComputeDevice(str(tmp_path))
    if not (device.processor and device._is_pocl):
        pytest.skip("another driver")
    options = cutout_options(tinted, False) if tinted else ()
    programs = [one for one in _listed(True, tinted, options) if one.for_processor]
    device.build_ahead(programs)
    deadline = time.monotonic() + 120
    while device.preparation() and time.monotonic() < deadline:
        time.sleep(0.05)
    built = {path.name for path in files(tmp_path)} - {"build_paces.json"}
    device.release()
    assert len(built) == len(programs) > 20
    assert sum(len(one.launches) for one in programs) > 80


def test_other_processes_compile_kernels_for_small_and_large_grids(context, many, tmp_path, monkeypatch):
    """PoCL keeps both versions, in a folder of the work-group size each."""
    if context.devices[0].platform.name != "Portable Computing Language":
        pytest.skip("another driver")
    monkeypatch.setenv("POCL_CACHE_DIR", str(tmp_path / "kernels"))
    both = [Launch("fill", (64,), ("b",), has_many) for has_many in (False, True)]
    wanted = [Program(SOURCE, (f"-DVALUE={value}.125f",), both[: 1 + value % 2]) for value in range(3)]
    cache = ProgramCache(context.devices[0], str(tmp_path / "programs"), keeps_itself=True)
    cache.begin(wanted)
    names = {program_name(*program[:2]) for program in wanted}
    deadline = time.monotonic() + 120
    while cache.preparation(names) and time.monotonic() < deadline:
        time.sleep(0.05)
    versions = [path.name for path in (tmp_path / "kernels").rglob("64-*") if path.is_dir()]
    assert len(versions) == 4 and len(set(versions)) == 2


def test_a_bake_with_programs_of_an_earlier_session_gives_the_same_bits(built, tmp_path, monkeypatch):
    monkeypatch.setattr(ComputeDevice, "_is_pocl", False)
    monkeypatch.setattr(ComputeDevice, "build_ahead", lambda self, programs: None)
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
