"""The worker process: its messages, and its failures, which never harm the parent."""

import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import is_dataclass, replace
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path
from typing import ClassVar, get_args, get_type_hints

import numpy as np
import pytest

from engine.bake_result import BakeResult
from engine.device.device_records import DeviceKey, DeviceRecords
from engine.errors import DeviceError, SceneError, SettingsError, WorkerCrashError, WorkerError
from engine.object_message import ObjectMessage, object_message
from engine.scene.model import Material, Mesh, Scene
from engine.settings import Settings
from engine.worker import child, messages, shared_block, shared_memory
from engine.worker import process as worker_process
from engine.worker.messages import PackedMessage
from engine.worker.worker import Worker, bake_without_crashing_device

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
SETTINGS = Settings(resolution=32, max_bounces=7, array_size=(1, 2, 3))


class RecordedMemory(SharedMemory):
    """Shared memory that remembers the names of all blocks made."""

    names: ClassVar[list[str]] = []

    def __init__(self, *args, **options):
        super().__init__(*args, **options)
        self.names.append(self.name)


@pytest.fixture
def start(monkeypatch, capfd, tmp_path):
    """Start workers on the bakes of `worker_bakes.py`; afterwards nothing of them may be left."""
    monkeypatch.setattr(shared_memory, "SharedMemory", RecordedMemory)
    monkeypatch.setattr(RecordedMemory, "names", [])
    monkeypatch.syspath_prepend(str(HERE))
    workers = []

    def start(bake, **options):
        workers.append(Worker(bake=f"worker_bakes:{bake}", **options))
        return workers[-1]

    # A short path, which `tmp_path` is not: sockets allow about 100 characters.
    with tempfile.TemporaryDirectory() as folder:
        monkeypatch.setattr(tempfile, "tempdir", folder)
        yield start
        processes = [worker.process for worker in workers if worker.process]
        for worker in workers:
            worker.stop()
        assert all(process.poll() is not None for process in processes)
        assert list(Path(folder).glob("hemibake-*")) == []
    assert [name for name in RecordedMemory.names if _exists(name)] == []
    assert capfd.readouterr().err == ""


def _exists(name):
    try:
        SharedMemory(name).close()
    except FileNotFoundError:
        return False
    return True


def _finish(job):
    """Drain a bake; return its progress and its lightmap."""
    steps = []
    while True:
        try:
            steps.append(next(job))
        except StopIteration as end:
            return [step for step in steps if step], end.value


def _first(job):
    """Return the first progress of a bake."""
    return next(step for step in job if step)


def _wait(condition, seconds=5):
    """Return whether a condition comes true in time."""
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.01)
    return condition()


def _reported(worker):
    """Return the next report of a preparation."""
    reports = []
    assert _wait(lambda: reports or reports.extend(filter(None, [worker.preparation()])), 20)
    return reports[0]


def _mesh(name, count, seed):
    random = np.random.default_rng(seed)
    positions = random.standard_normal((count, 3, 3)).astype(np.float32)
    positions[0, 0] = np.nan, -0.0, np.inf
    uvs = np.asfortranarray(random.random((count, 3, 2), np.float32))
    index = np.arange(2 * count, dtype=np.int32)
    return Mesh(name, positions, positions[:, ::-1], uvs, index[::2], index[:count], index[:count] % 2, 1)


def _scene(name="Würfel", atlases=("a", "b")):
    grey = np.full(3, 0.5, np.float32)
    return Scene((_mesh(name, 100, 0), _mesh("two", 1, 1)), (Material("m", grey, grey / 3),), atlases, grey)


def _same(one, two):
    """Compare two values and everything in them, arrays bit for bit."""
    if isinstance(one, np.ndarray):
        same_kind = (one.dtype, one.shape) == (two.dtype, two.shape)
        return same_kind and one.tobytes() == two.tobytes()
    if hasattr(one, "__dataclass_fields__"):
        return type(one) is type(two) and _same(vars(one), vars(two))
    if isinstance(one, dict):
        return one.keys() == two.keys() and all(_same(one[key], two[key]) for key in one)
    if isinstance(one, tuple):
        return len(one) == len(two) and all(map(_same, one, two))
    return type(one) is type(two) and one == two


def test_lightmap_is_the_one_of_the_same_bake_in_process(start):
    import worker_bakes

    steps, lightmap = _finish(start("echo").bake(_scene(), SETTINGS))
    here_steps, here = _finish(worker_bakes.echo(_scene(), SETTINGS))
    assert isinstance(lightmap, BakeResult)
    assert _same(replace(lightmap, report=None), replace(here, report=None))
    assert _same(replace(lightmap.report, devices={}), replace(here.report, devices={}))
    assert steps and _same(steps[-1], here_steps[-1])


def test_scene_and_settings_arrive_bit_for_bit(start):
    assert _same(_finish(start("return_scene").bake(_scene(), SETTINGS))[1], (_scene(), SETTINGS))


def test_messages_about_objects_arrive_from_a_package_of_another_name():
    """In the worker the package is `engine`, in Blender the module of an extension."""
    parcel = PackedMessage(object_message("Objects {}: overlap. Unwrap.", ["Würfel"], "unwrap"))
    memory = bytearray(parcel.size)
    parcel.write(memoryview(memory))
    there = memoryview(bytes(memory).replace(b"engine.object_message", b"others.object_message"))
    with pytest.raises(ModuleNotFoundError):
        __import__("others.object_message")
    arrived = messages.read(there)
    assert type(arrived) is ObjectMessage
    assert (str(arrived), arrived.objects, arrived.fix) == (
        "Objects 'Würfel': overlap. Unwrap.", ("Würfel",), "unwrap",
    )  # fmt: skip


def test_process_starts_with_the_first_bake_and_serves_the_next(start):
    worker = start("echo")
    assert worker.process is None and not worker.alive
    pids = {_finish(worker.bake(_scene(), SETTINGS))[1].report.devices["pid"] for _ in range(2)}
    assert worker.alive and pids == {str(worker.process.pid)}
    worker.stop()
    worker.stop()
    assert worker.process is None and not worker.alive


@pytest.mark.parametrize("error", [SceneError, SettingsError, DeviceError])
def test_error_keeps_its_class_and_message(start, error):
    import worker_bakes

    worker = start("fail")
    scene = _scene(error.__name__)
    with pytest.raises(error) as here:
        _finish(worker_bakes.fail(scene, SETTINGS))
    with pytest.raises(error) as there:
        _finish(worker.bake(scene, SETTINGS))
    assert type(there.value) is error and str(there.value) == str(here.value)
    assert worker.alive


def test_bug_brings_its_traceback_and_ends_the_process(start):
    worker = start("fail")
    with pytest.raises(WorkerError, match=r"(?s)ZeroDivisionError: the deeper cause\. Please.*bakes\.py"):
        _finish(worker.bake(_scene("bug"), SETTINGS))
    assert not worker.alive


def test_next_is_quick_and_progress_is_the_newest(start):
    job = start("endless").bake(_scene(atlases=(os.devnull,)), SETTINGS)
    assert _first(job).iteration < 100
    time.sleep(0.5)

    # What lay in the block while nobody looked is old; what follows is not a queue of all between.
    first, second = _first(job).iteration, _first(job).iteration
    assert second > first + 20

    waits = []
    for _ in range(50):
        begun = time.perf_counter()
        next(job)
        waits.append(time.perf_counter() - begun)
    assert np.median(waits) < 0.01
    job.close()


def test_an_intermediate_lightmap_is_never_torn(start):
    job = start("endless").bake(_scene(atlases=(os.devnull,)), SETTINGS)
    intermediates = [step.intermediate for step, _ in zip(filter(None, job), range(30), strict=False)]
    assert all(len(np.unique(intermediate)) == 1 for intermediate in intermediates)
    assert len({intermediate[0, 0, 0, 0] for intermediate in intermediates}) == 30
    job.close()


def test_memory_of_the_scene_is_given_back_once_the_child_has_read_it(start):
    mesh = _mesh("large", 250_000, 2)
    scene = replace(_scene(atlases=(os.devnull,)), meshes=(mesh,))
    job = start("endless").bake(scene, SETTINGS)
    _first(job)
    there = [SharedMemory(name) for name in RecordedMemory.names if _exists(name)]
    assert sum(memory.size for memory in there) < mesh.positions.nbytes / 4
    for memory in there:
        memory.close()
    job.close()


def test_talkative_child_is_not_held_up(start):
    job = start("chatter").bake(_scene(), SETTINGS)
    next(job)
    time.sleep(0.2)
    steps, lightmap = _finish(job)
    assert isinstance(lightmap, BakeResult)
    assert len(steps) < 10_000


def test_close_cancels_in_the_child(start, tmp_path):
    worker = start("endless")
    job = worker.bake(_scene(atlases=(str(tmp_path / "mark"),)), SETTINGS)
    _first(job)
    pid = worker.process.pid
    job.close()
    assert (tmp_path / "mark").read_text() == "closed"
    _first(worker.bake(_scene(atlases=(os.devnull,)), SETTINGS))
    assert worker.process.pid == pid


def test_close_before_the_first_next_starts_nothing(start):
    worker = start("endless")
    worker.bake(_scene(), SETTINGS).close()
    assert worker.process is None


def test_close_while_the_child_starts(start):
    worker = start("echo")
    job = worker.bake(_scene(), SETTINGS)
    next(job)
    job.close()
    assert not worker.alive
    assert isinstance(_finish(worker.bake(_scene(), SETTINGS))[1], BakeResult)


def test_deaf_child_is_killed_by_close(start, monkeypatch):
    monkeypatch.setattr(worker_process, "PATIENCE", 0.3)
    worker = start("deaf")
    job = worker.bake(_scene(), SETTINGS)
    _first(job)
    old = worker.process
    begun = time.monotonic()
    job.close()
    assert time.monotonic() - begun < 2
    assert old.poll() is not None and not worker.alive


def test_stop_in_the_middle_of_a_bake(start):
    worker = start("endless")
    job = worker.bake(_scene(atlases=(os.devnull,)), SETTINGS)
    _first(job)
    worker.stop()
    with pytest.raises(WorkerError, match="was stopped"):
        next(job)


def test_killed_child_is_reported_and_replaced(start):
    worker = start("echo")
    _finish(worker.bake(_scene(), SETTINGS))
    job = worker.bake(_scene(), SETTINGS)
    next(job)
    worker.process.kill()
    with pytest.raises(WorkerError, match="Bake again to start a new process"):
        _finish(job)
    assert not worker.alive
    assert isinstance(_finish(worker.bake(_scene(), SETTINGS))[1], BakeResult)


def test_child_that_died_between_bakes_is_replaced(start):
    worker = start("echo")
    _finish(worker.bake(_scene(), SETTINGS))
    worker.process.kill()
    worker.process.wait()
    assert isinstance(_finish(worker.bake(_scene(), SETTINGS))[1], BakeResult)


def test_what_is_called_runs_in_the_process_of_the_bakes_before_the_next_one(start, tmp_path):
    """A call starts the process and does not wait; a bake that follows at once finds all of it done."""
    worker, notes = start("echo"), tmp_path / "notes"
    for text in ("first", "second"):
        worker.call("worker_bakes:note", str(notes), text)
    lightmap = _finish(worker.bake(_scene(), SETTINGS))[1]
    pid = lightmap.report.devices["pid"]
    assert notes.read_text() == f"{pid} first\n{pid} second\n"


def test_a_preparation_reports_its_stage_until_the_next_bake(start, tmp_path):
    worker, notes = start("echo"), tmp_path / "notes"
    worker.prepare("worker_bakes:prepare", str(notes))
    stage, seconds = _reported(worker)
    assert stage.startswith("Preparing: ") and seconds == 12.5
    lightmap = _finish(worker.bake(_scene(), SETTINGS))[1]
    assert notes.read_text() == f"{lightmap.report.devices['pid']} closed\n"
    assert worker.preparation() is None


def test_a_preparation_that_fails_ends_and_is_printed(start):
    worker = start("echo")
    worker.prepare("worker_bakes:no_such_function")
    assert _reported(worker) == ("", 0.0) and "no_such_function" in worker.printed()


def test_a_call_that_fails_is_printed_and_harms_nothing(start):
    worker = start("echo")
    worker.call("worker_bakes:no_such_function")
    assert isinstance(_finish(worker.bake(_scene(), SETTINGS))[1], BakeResult)
    assert "no_such_function" in worker.printed()


def test_a_call_in_the_middle_of_a_bake_is_left_out(start, tmp_path):
    worker, notes = start("echo"), tmp_path / "notes"
    job = worker.bake(_scene(), SETTINGS)
    _first(job)
    worker.call("worker_bakes:note", str(notes), "now")
    assert isinstance(_finish(job)[1], BakeResult)
    assert not notes.exists()


def test_crash_shows_exit_status_and_last_words(start):
    with pytest.raises(WorkerError, match=r"(?s)exit status 3.*last words"):
        _finish(start("crash").bake(_scene(), SETTINGS))


def test_a_bake_goes_on_without_a_device_whose_driver_crashes(start, tmp_path):
    """Later workers skip it as well, until its driver has another version."""
    settings = replace(SETTINGS, cache_dir=str(tmp_path))
    worker, scene = start("crash_on_device"), _scene()
    assert isinstance(_finish(bake_without_crashing_device(worker, scene, settings, {}))[1], BakeResult)
    (sentence,) = DeviceRecords(str(tmp_path)).skipped().values()
    assert "'Platform: Crashing': its driver crashed" in sentence and "Update the driver" in sentence
    assert sorted(path.name for path in tmp_path.iterdir()) == ["skipped_devices.json"]
    again = start("crash_on_device")
    assert isinstance(_finish(again.run(scene, settings, {}))[1], BakeResult)


def test_a_driver_that_crashes_when_it_is_started_is_started_once(start, tmp_path):
    """Bakes do without OpenCL until the cache is cleared, unless the user has chosen a device."""
    settings = replace(SETTINGS, cache_dir=str(tmp_path))
    worker, scene = start("crash_in_search"), _scene()
    assert isinstance(_finish(bake_without_crashing_device(worker, scene, settings, {}))[1], BakeResult)
    (sentence,) = DeviceRecords(str(tmp_path)).skipped().values()
    assert "OpenCL driver crashed" in sentence and "clear the cache" in sentence
    assert isinstance(_finish(start("crash_in_search").run(scene, settings, {}))[1], BakeResult)
    with pytest.raises(WorkerCrashError):
        _finish(worker.run(scene, replace(settings, opencl_device="Platform: Chosen"), {}))


@pytest.mark.parametrize("changes", [{"max_bounces": 13}, {"opencl_device": "Platform: Crashing"}])
def test_a_crash_that_another_device_does_not_end_or_that_is_chosen_is_an_error(start, tmp_path, changes):
    settings = replace(SETTINGS, cache_dir=str(tmp_path), **changes)
    with pytest.raises(WorkerCrashError):
        _finish(bake_without_crashing_device(start("crash_on_device"), _scene(), settings, {}))
    assert DeviceRecords(str(tmp_path)).skipped() == {}


def test_a_process_that_ends_without_a_fault_blames_no_device(start, tmp_path):
    settings = replace(SETTINGS, cache_dir=str(tmp_path))
    DeviceRecords(str(tmp_path)).use(DeviceKey("c3", "Platform: Other"))
    with pytest.raises(WorkerError) as caught:
        _finish(start("crash").run(_scene(), settings))
    assert not isinstance(caught.value, WorkerCrashError)


@pytest.mark.parametrize("content", ["", "[1]", '{"a": 1}', "{"])
def test_damaged_records_of_devices_count_as_none(tmp_path, content):
    (tmp_path / "skipped_devices.json").write_text(content)
    records, device = DeviceRecords(str(tmp_path)), DeviceKey("d4", "Platform: Device")
    assert records.skipped() == {}
    records.skip(device, "crashed")
    assert list(records.skipped()) == ["d4"]
    records.allow(device)
    assert records.skipped() == {} and not DeviceRecords(None).skipped()


def test_second_bake_at_once_is_refused(start):
    worker = start("endless")
    job = worker.bake(_scene(atlases=(os.devnull,)), SETTINGS)
    _first(job)
    with pytest.raises(WorkerError, match="Another bake is running"):
        next(worker.bake(_scene(), SETTINGS))
    assert _first(job)
    job.close()


def test_child_that_cannot_import_is_noticed_at_once(start):
    begun = time.monotonic()
    with pytest.raises(WorkerError, match=r"(?s)could not start \(exit status 1\).*no_such_bake"):
        _finish(start("no_such_bake").bake(_scene(), SETTINGS))
    assert time.monotonic() - begun < 10


def test_missing_executable_is_named(start):
    with pytest.raises(WorkerError, match="could not be started.*no-such-python"):
        next(start("echo", executable="no-such-python").bake(_scene(), SETTINGS))


@pytest.mark.skipif(sys.platform == "win32", reason="needs a shell script")
def test_silent_child_is_given_up(start, tmp_path):
    script = tmp_path / "silent"
    script.write_text("#!/bin/sh\nexec sleep 60\n")
    script.chmod(0o700)
    with pytest.raises(WorkerError, match="did not answer within 0.3 s"):
        _finish(start("echo", executable=str(script), start_limit=0.3).bake(_scene(), SETTINGS))


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")
def test_parent_survives_a_dead_child_where_sigpipe_is_deadly(start):
    worker = start("endless")
    job = worker.bake(_scene(atlases=(os.devnull,)), SETTINGS)
    _first(job)
    old = signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    try:
        worker.process.kill()
        worker.process.wait()
        job.close()
        assert signal.getsignal(signal.SIGPIPE) == signal.SIG_DFL
    finally:
        signal.signal(signal.SIGPIPE, old)


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")
def test_child_ends_when_its_parent_is_killed_before_it_has_answered(tmp_path):
    environment = os.environ | {"PYTHONPATH": f"{HERE}{os.pathsep}{ROOT}", "TMPDIR": str(tmp_path)}
    command = [sys.executable, "-c", EARLY_PARENT]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as parent:
        pid = int(parent.stdout.readline())
        parent.send_signal(signal.SIGKILL)
    assert _wait(lambda: _ended(pid), seconds=15)
    assert os.listdir(tmp_path) == []


EARLY_PARENT = """
import time
from test_worker import SETTINGS, _scene
from engine.worker.worker import Worker
worker = Worker(bake="worker_bakes:endless")
job = worker.bake(_scene(), SETTINGS)
next(job)
print(worker.process.pid, flush=True)
time.sleep(60)
"""

PARENT = """
import sys
from test_worker import RecordedMemory, SETTINGS, _first, _scene
from engine.worker import shared_memory
from engine.worker.worker import Worker
shared_memory.SharedMemory = RecordedMemory
worker = Worker(bake="worker_bakes:endless")
job = worker.bake(_scene(atlases=(sys.argv[1],)), SETTINGS)
_first(job)
print(worker.process.pid, *RecordedMemory.names, flush=True)
for step in job:
    pass
"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")
def test_child_ends_when_its_parent_is_killed(tmp_path):
    environment = os.environ | {"PYTHONPATH": f"{HERE}{os.pathsep}{ROOT}", "TMPDIR": str(tmp_path)}
    command = [sys.executable, "-c", PARENT, str(tmp_path / "mark")]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as parent:
        pid, *names = parent.stdout.readline().split()
        assert names and any(map(_exists, names))
        parent.send_signal(signal.SIGKILL)

    # The bake was closed, the process is gone, and so are its socket and its shared memory.
    assert _wait(lambda: _ended(int(pid)))
    assert (tmp_path / "mark").read_text() == "closed"
    assert _wait(lambda: not any(map(_exists, names)))
    assert os.listdir(tmp_path) == ["mark"]


def _ended(pid):
    """Return whether a process is gone, or dead and not yet buried."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    status = Path(f"/proc/{pid}/stat")
    return status.exists() and status.read_text().split()[2] == "Z"


def _settled(job):
    """Return the next finished lightmap of a bake that follows."""
    return next(step for step in job if isinstance(step, BakeResult))


def test_changes_reach_a_bake_that_follows_at_work_and_at_rest(start):
    worker = start("echo")
    job = worker.follow("worker_bakes:follow", _scene(), SETTINGS)
    worker_process = _settled(job).report.devices
    large = np.arange(300_000, dtype=np.float32)
    for changes in (["one"], ["two", "three"], [large]):
        for change in changes:
            worker.update(change)
        last = _settled(job)
        assert last.report.reasons[-1] == str(changes[-1])
    assert last.report.reasons == ("one", "two", "three", str(large))
    job.close()
    assert worker.alive

    # The same process then bakes normally.
    _, lightmap = _finish(worker.bake(_scene(), SETTINGS))
    assert lightmap.report.devices == worker_process and lightmap.report.reasons == ("Asked for.",)


def test_a_lightmap_of_the_scene_before_a_change_is_dropped(start):
    """The change leaves when the lightmap is all but finished."""
    worker = start("echo")
    job = worker.follow("worker_bakes:follow_slowly", _scene(), SETTINGS)
    _first(job)
    worker.update("one")
    assert _settled(job).report.reasons == ("one",)
    job.close()


def test_a_bake_that_follows_tells_its_error_and_leaves_no_changes_behind(start):
    worker = start("echo")
    job = worker.follow("worker_bakes:follow", _scene(), SETTINGS)
    _settled(job)
    for change in ("end", "more", "even more"):
        worker.update(change)
    with pytest.raises(SceneError, match="The end"):
        list(job)
    worker.update("late")
    again = worker.follow("worker_bakes:follow", _scene(), SETTINGS)
    assert _settled(again).report.reasons == ()
    again.close()


def test_a_killed_child_that_followed_is_reported(start):
    worker = start("echo")
    job = worker.follow("worker_bakes:follow", _scene(), SETTINGS)
    _settled(job)
    worker.process.kill()
    worker.update("one")
    with pytest.raises(WorkerError, match="baking process"):
        list(job)


def test_memory_that_is_not_there_is_refused(start):
    huge = PackedMessage(None)
    huge.size = 1 << 50
    with pytest.raises(WorkerError, match="no room for 1073741824 MiB"):
        shared_block.SharedBlock(huge)


@pytest.mark.parametrize("size", [101, 70_001])
def test_a_block_is_removed_before_its_successor_is_made(size, monkeypatch):
    create, before = shared_block.create_memory, []
    with shared_block.SharedBlock(PackedMessage(bytes(9973))) as block:
        first = block.name

        def create_alone(wanted):
            with pytest.raises(FileNotFoundError):
                shared_memory.attach_memory(first)
            before.append(wanted)
            return create(wanted)

        monkeypatch.setattr(shared_block, "create_memory", create_alone)
        block.grow(size)
        assert before == [size]
        with shared_block.BorrowedBlock(block.name) as borrowed:
            assert borrowed.write(PackedMessage("text")) and block.read() == "text"


def test_a_block_without_room_for_its_successor_ends_without_another_error(monkeypatch):
    with shared_block.SharedBlock(PackedMessage("text")) as block:
        monkeypatch.setattr(shared_memory, "_room", lambda: 0)
        with pytest.raises(WorkerError, match="no room"):
            block.grow(1 << 20)


def test_parcel_takes_numbers_as_they_are():
    parcel = PackedMessage((math.nan, -0.0, "ü", None, True, b""))
    memory = memoryview(bytearray(parcel.size))
    parcel.write(memory)
    nan, zero, *rest = shared_block.messages.read(memory)
    assert math.isnan(nan) and math.copysign(1, zero) == -1 and rest == ["ü", None, True, b""]


def test_all_records_in_records_that_travel_do_so_too():
    """One that is not known arrives as a class of this Python's path, which another process may not have."""
    for record in messages.RECORDS.values():
        hints = [*get_type_hints(record).values()]
        while hints:
            hint = hints.pop()
            hints += get_args(hint)
            assert not is_dataclass(hint) or messages.RECORDS.get(hint.__name__) is hint, (record, hint)


@pytest.mark.skipif(sys.platform == "win32", reason="The parent sets the priority on Windows")
@pytest.mark.parametrize(("before", "after"), [(0, 10), (4, 14), (10, 15), (19, 19)])
def test_worker_has_a_lower_priority_that_still_gives_it_time(monkeypatch, before, after):
    values = [before]

    def nice(increase):
        values.append(values[-1] + increase)
        return values[-1]

    monkeypatch.setattr(child.os, "nice", nice)
    child._yield_to_the_window()
    assert values[-1] == after
