"""Bakes by Dask workers: the same bits for any number of workers, whatever is lost on the way."""

import gc
import itertools
import socket
import sys
import time
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import psutil
import pytest
from distributed.utils import LoopRunner

import engine
from engine import Light, Settings
from engine.cluster import admission, block, local_workers, prepared_scene
from engine.cluster.blocks import cut
from engine.errors import DeviceError, OverlapError, SettingsError
from engine.progress import finished
from engine.scene.model import BackSide
from engine.scene.probe_volume import ProbeVolume
from engine.scene.transmission import Transmittance
from engine.session import Session
from tests.analytic.scenes import nine_quad_room
from tests.gpu.schedulers import ONE_THREAD, running_scheduler
from tests.transparency import uniform_transmission

#: Each test starts workers.
pytestmark = pytest.mark.long

#: Odd, so that the last block is a short one.
SETTINGS = Settings(resolution=45, samples=100, visibility="rays", texel_samples=1, intermediates=False)

#: Every task of workers is in it.
IN_TEXELS = replace(SETTINGS, texel_samples=4)


@contextmanager
def cluster(count):
    made = local_workers.LocalWorkers([ONE_THREAD] * count)
    try:
        yield made
    finally:
        made.close()


@pytest.fixture(scope="module")
def two():
    with cluster(2) as made:
        yield made


@pytest.fixture(scope="module")
def by_two(two):
    return baked(two)


def baked(made, settings=SETTINGS, scene=None):
    return finished(bake(made, settings, scene))


def bake(made, settings=SETTINGS, scene=None):
    """Return the generator of a bake by workers."""
    address = made.client.scheduler_info()["address"]
    return Session().bake(scene or nine_quad_room(), replace(settings, scheduler=address))


@pytest.mark.parametrize("count", [1, 15, 16, 17, 1009, (1 << 18) * 20 + 1])
def test_blocks_hold_every_patch_once(count):
    spans = cut(count)
    assert spans[0][0] == 0 and spans[-1][1] == count
    assert all(last == first for (_, last), (first, _) in itertools.pairwise(spans))
    assert max(last - first for first, last in spans) <= 1 << 18
    assert cut(count, 2048)[0][1] == min(count, max(2048, spans[0][1]))


def test_workers_bring_the_light_of_one_device(by_two):
    alone = finished(engine.bake(nine_quad_room(), SETTINGS))
    assert by_two.report.patches == alone.report.patches
    light, expected = (lightmap.image[alone.has_patch] for lightmap in (by_two, alone))
    assert light.mean() == pytest.approx(expected.mean(), rel=2e-3)

    # Rays of blocks are turned otherwise: this is the noise of 100 of them.
    assert np.sqrt(((light - expected) ** 2).mean()) < 0.08 * expected.mean()
    assert any("2 Dask workers" in reason for reason in by_two.report.reasons)


def two_sided_room():
    """Return a room whose light has a bluish back, and whose blue panel tints light."""
    *others, panel, yellow, light = nine_quad_room().materials
    tinted = uniform_transmission(Transmittance(np.float32([0.6, 0.4, 0.1])))
    light = replace(light, back=BackSide(light.reflectance, light.emission * np.float32([0.1, 0.3, 1])))
    materials = (*others, replace(panel, transmission=tinted), yellow, light)
    return replace(nine_quad_room(), materials=materials)


def test_workers_make_every_output_and_points_of_texels(two):
    names = ("combined", "direct", "directional", "ambient_occlusion", "shadow_mask")
    lamp = Light("Lamp", "point", np.array([0.4, 0.5, 0.6]), np.eye(3), np.full(3, 2, np.float32), 0.1)
    scene = replace(two_sided_room(), lights=(lamp,))
    settings = replace(SETTINGS, samples=256, outputs=names, texel_samples=4)
    alone = finished(engine.bake(scene, replace(settings, seed=1)))
    by_two = baked(two, settings, scene)
    assert by_two.passes.keys() == alone.passes.keys()
    both = alone.known & by_two.known
    scale = alone.passes["combined"][both].mean()
    for name, expected in alone.passes.items():
        difference = (by_two.passes[name] - expected)[both]
        assert abs(difference.mean()) < 0.02 * scale
        assert np.sqrt((difference**2).mean()) < 0.15 * scale
    assert any("more points" in reason for reason in by_two.report.reasons)
    assert by_two.report.energy.emitted == pytest.approx(alone.report.energy.emitted, rel=0.01)


def with_probes(scene):
    """Return a scene with a light, a grid that crosses its walls and a small one inside."""
    wide, small = np.diag([0.6, 0.55, 0.5, 1.0]), np.diag([0.2, 0.3, 0.1, 1.0])
    wide[:3, 3] = small[:3, 3] = 0.5
    grids = ProbeVolume("Wide", wide, (7, 6, 5)), ProbeVolume("Small", small, (1, 2, 1))
    lamp = Light("Lamp", "point", np.array([0.4, 0.5, 0.6]), np.eye(3), np.full(3, 2, np.float32), 0.1)
    return replace(scene, lights=(lamp,), probe_volumes=grids)


def test_workers_gather_light_probes(two):
    """Their light is that of one device up to noise, and has the same bits with one worker."""
    scene = with_probes(nine_quad_room())
    settings = replace(SETTINGS, light_probes=True, probe_distances=True, samples=256)
    alone = finished(engine.bake(scene, settings))
    by_two = baked(two, settings, scene)
    with cluster(1) as one:
        by_one = baked(one, settings, scene)
    for grid, same, expected in zip(by_two.probes, by_one.probes, alone.probes, strict=True):
        assert np.array_equal(grid.coefficients, same.coefficients)
        assert np.array_equal(grid.distances, same.distances)
        scale = expected.coefficients[:, 0].mean()
        assert (grid.validity == expected.validity).mean() > 0.95
        difference = grid.coefficients - expected.coefficients
        assert abs(difference[:, 0].mean()) < 0.01 * scale
        assert np.sqrt((difference**2).mean()) < 0.05 * scale
        assert grid.distances.mean() == pytest.approx(expected.distances.mean(), rel=0.01)


def test_a_cancelled_bake_leaves_no_task_of_probes(two):
    """The next bake of the same workers has the bits of a bake that was not cancelled."""
    scene, settings = with_probes(nine_quad_room()), replace(SETTINGS, light_probes=True)
    whole = baked(two, settings, scene)
    work = bake(two, settings, scene)
    assert any(step.stage == "Light probes" for step in work)
    work.close()
    again = baked(two, settings, scene)
    assert np.array_equal(whole.probes[0].coefficients, again.probes[0].coefficients)


def test_any_number_of_workers_brings_the_same_bits(by_two):
    with cluster(1) as one:
        assert np.array_equal(baked(one).image, by_two.image)


def test_bits_are_the_same_where_light_travels_through_dask(monkeypatch, two, by_two):
    monkeypatch.setattr("engine.cluster.workers.Workers._share_folder", lambda _: False)
    assert np.array_equal(baked(two).image, by_two.image)


def test_bits_are_the_same_without_room_in_memory(monkeypatch, two, by_two):
    def full(*_):
        raise OSError("No space left on device")

    monkeypatch.setattr("os.posix_fallocate", full)
    assert np.array_equal(baked(two).image, by_two.image)


def test_nothing_is_left_in_the_memory_of_the_machine(monkeypatch, tmp_path, two, by_two):
    """Scene, index map, and three columns of patches are files; sweeps take turns with two memories.

    Each of these has a file of light and one of rows.
    """
    monkeypatch.setattr("engine.cluster.memory_folder._MEMORY", tmp_path)
    made = set()
    for _ in bake(two):
        made |= {path.name for folder in tmp_path.iterdir() for path in folder.iterdir()}
    assert len(made) == 9 and not list(tmp_path.iterdir())


def test_all_devices_of_this_machine_work_for_a_bake(monkeypatch, by_two):
    """Stands for two cards: two workers of one thread each."""
    monkeypatch.setattr("engine.cluster.workers.local_environments", lambda: [ONE_THREAD] * 2)
    alone = finished(Session().bake(nine_quad_room(), replace(SETTINGS, scheduler="all")))
    (told,) = (reason for reason in alone.report.reasons if "2 Dask workers" in reason)
    assert "dashboard" not in told
    assert any("dashboard: http" in reason for reason in by_two.report.reasons)
    assert np.array_equal(alone.image, by_two.image)


def test_nothing_of_them_listens_to_other_machines():
    """The scheduler, its page about tasks, and a worker."""
    with cluster(1):
        here = psutil.Process()
        listening = [
            connection.laddr.ip
            for process in (here, *here.children(recursive=True))
            for connection in process.net_connections("tcp")
            if connection.status == psutil.CONN_LISTEN
        ]
    assert len(listening) >= 3 and set(listening) <= {"127.0.0.1", "::1"}


def test_squares_of_patches_bring_the_light_of_one_device(two):
    settings = replace(
        SETTINGS, samples=256, patch_groups=2, texel_samples=4, outputs=("combined", "indirect")
    )
    alone = finished(engine.bake(nine_quad_room(), settings))
    by_two = baked(two, settings)
    both = alone.known & by_two.known
    for name, expected in alone.passes.items():
        difference = (by_two.passes[name] - expected)[both]
        assert abs(difference.mean()) < 0.01 * expected[both].mean()
        assert np.sqrt((difference**2).mean()) < 0.1 * expected[both].mean()
    with cluster(1) as one:
        assert np.array_equal(baked(one, settings).display, by_two.display)


@pytest.mark.long
@pytest.mark.parametrize("steps", [1, 2, 4, 9, 17, 30])
def test_a_worker_that_is_lost_changes_no_bit(by_two, steps):
    """A worker is killed after so many steps of a bake: while views are found, or in a sweep."""
    with cluster(2) as made:
        work = bake(made)
        for _ in range(steps):
            next(work)
        made.kill(0)
        assert np.array_equal(finished(work).image, by_two.image)


@pytest.mark.long
@pytest.mark.parametrize(
    "stage", ["Direct light", "Visibility", "Bounce 2", "Supersampling", "Finishing lightmaps"]
)
def test_a_worker_that_is_lost_in_a_stage_changes_no_bit(by_two_in_texels, stage):
    with cluster(2) as made:
        work = bake(made, IN_TEXELS)
        while next(work).stage != stage:
            pass
        made.kill(1)
        assert np.array_equal(finished(work).display, by_two_in_texels.display)


@pytest.fixture(scope="module")
def by_two_in_texels(two):
    return baked(two, IN_TEXELS)


def test_tasks_whose_results_are_taken_are_forgotten(monkeypatch, two):
    """Else those of a worker that is lost later were done again, though nobody needs them any more."""
    monkeypatch.setattr("engine.cluster.tasks._PAUSE", 1e-3)
    gc.disable()
    try:
        work = bake(two, IN_TEXELS)
        while next(work).stage != "Finishing lightmaps":
            pass
        deadline = time.monotonic() + 10
        while kinds_of_tasks(two) & {"sampled", "find", "views", "gather_to", "light_at_samples"}:
            assert time.monotonic() < deadline, kinds_of_tasks(two)
            time.sleep(0.05)
        finished(work)
    finally:
        gc.enable()


def kinds_of_tasks(made):
    """Return the names of all tasks that a scheduler knows."""
    keys = made.client.run_on_scheduler(lambda dask_scheduler: list(dask_scheduler.tasks))
    return {key.split("-")[0] for key in keys}


def test_a_scheduler_that_is_gone_is_an_error_with_the_remedy(tmp_path):
    with running_scheduler(tmp_path) as (address, process):
        work = Session().bake(nine_quad_room(), replace(SETTINGS, scheduler=address))
        while next(work).stage != "Bounce 2":
            pass
        process.kill()
        with pytest.raises(DeviceError, match="cannot be reached any more.*Start it again"):
            finished(work)


def test_a_worker_that_is_gone_is_not_waited_for_long(monkeypatch):
    """By Dask's defaults its scheduler tries for 30 s to reach it."""
    monkeypatch.setattr(local_workers, "RESULTS", 1)
    with cluster(1) as made, socket.create_server(("127.0.0.1", 0)) as listening:
        address = f"tcp://127.0.0.1:{listening.getsockname()[1]}"
        listening.close()
        began = time.monotonic()
        with pytest.raises(OSError, match="Timed out trying to connect"):
            made.client.sync(made._cluster.scheduler.rpc.connect, address)
        assert time.monotonic() - began < 10


def test_images_are_made_and_saved_without_workers_and_scheduler(tmp_path, by_two_in_texels):
    """All are killed once points of texels are lit."""
    with running_scheduler(tmp_path) as (address, _):
        work = Session().bake(nine_quad_room(), replace(IN_TEXELS, scheduler=address))
        while next(work).stage != "Finishing lightmaps":
            pass
    assert np.array_equal(finished(work).display, by_two_in_texels.display)


def test_light_goes_on_by_another_scheduler(tmp_path, by_two):
    """Results from before the end of the first scheduler are in a checkpoint."""
    cache, settings = tmp_path / "cache", replace(SETTINGS, checkpoint_interval=0)
    settings = replace(settings, cache_dir=str(cache))
    with running_scheduler(tmp_path) as (address, process):
        work = Session().bake(nine_quad_room(), replace(settings, scheduler=address))
        while next(work).stage != "Bounce 4":
            pass
        process.kill()
        with pytest.raises(DeviceError, match=f"{address} cannot be reached any more"):
            finished(work)
    assert list(cache.rglob("light"))
    (tmp_path / "scheduler.json").unlink()
    with running_scheduler(tmp_path) as (other, _):
        assert other != address
        lightmap = finished(Session().bake(nine_quad_room(), replace(settings, scheduler=other)))
    assert any("restored from bounce 3" in sentence for sentence in lightmap.report.resumed)
    assert np.array_equal(lightmap.image, by_two.image)
    assert not list(cache.rglob("light"))


@pytest.mark.long
def test_a_slow_device_gets_fewer_blocks():
    with cluster(2) as made:
        # Both have built their kernels by then.
        finished(bake(made))
        slow_one, quick_one = made.client.scheduler_info(n_workers=-1)["workers"]
        for worker, seconds in ((slow_one, 1), (quick_one, 0)):
            made.client.run(count_blocks, seconds, workers=[worker])
        blocks = len(cut(finished(bake(made)).report.patches))
        found = made.client.run(counted_blocks)
        assert found[slow_one] + found[quick_one] >= blocks
        assert 0 < found[slow_one] < found[quick_one]


def count_blocks(seconds):
    """Have this worker count the blocks that it finds, and take so much longer for each."""
    find, block.counted = block.BlockVisibility.__init__, 0

    def find_slowly(self, *arguments):
        time.sleep(seconds)
        find(self, *arguments)
        block.counted += 1

    block.BlockVisibility.__init__ = find_slowly


def counted_blocks():
    return block.counted


@pytest.mark.long
def test_a_worker_that_joins_is_used(by_two):
    with cluster(1) as made:
        work = bake(made)
        next(work)
        made.add(ONE_THREAD)
        made.client.wait_for_workers(2, timeout=60)
        first, joined = made.client.scheduler_info(n_workers=-1)["workers"]
        made.client.get_task_stream(count=0)
        began = time.time()
        assert np.array_equal(finished(work).image, by_two.image)
        done = made.client.get_task_stream(start=began)
    finders = {task["worker"] for task in done if task["key"].startswith("find-")}
    assert finders == {first, joined}


def test_no_workers_for_long_are_an_error_with_the_remedy(monkeypatch):
    monkeypatch.setattr("engine.cluster.tasks._PATIENCE", 2.0)
    with cluster(1) as made:
        work = bake(made)
        while next(work).stage != "Bounce 2":
            pass
        made.kill(0)
        with pytest.raises(DeviceError, match="has had no workers for 2 s. Start some"):
            finished(work)


@pytest.mark.long
def test_triangles_stay_on_workers_when_only_light_changes(two, by_two):
    lamp = Light("Lamp", "point", np.array([0.4, 0.5, 0.6]), np.eye(3), np.full(3, 2, np.float32), 0.1)
    scene = replace(nine_quad_room(), lights=(lamp,))
    baked(two)
    before = two.client.run(kept_triangles)
    again = baked(two, scene=scene)
    assert two.client.run(kept_triangles) == before
    with cluster(1) as fresh:
        assert np.array_equal(baked(fresh, scene=scene).image, again.image)
    assert not np.array_equal(again.image, by_two.image)


def kept_triangles():
    """Return the array that holds the triangles of this worker."""
    return id(prepared_scene._kept._last[1].triangles.positions)


def test_worker_of_another_version_is_refused_by_name(monkeypatch):
    monkeypatch.setattr(admission, "source_digest", lambda: "of tomorrow")
    with cluster(1) as made, pytest.raises(DeviceError, match="another version"):
        baked(made)


def test_a_worker_that_cannot_be_started_leaves_none_of_the_others(monkeypatch):
    start, started = local_workers.start_worker, []

    def start_one(*arguments):
        if started:
            raise OSError("too many processes")
        started.append(start(*arguments))
        return started[0]

    monkeypatch.setattr(local_workers, "start_worker", start_one)
    with pytest.raises(OSError, match="too many processes"):
        local_workers.LocalWorkers([ONE_THREAD] * 2)
    assert started[0].poll() is not None


def test_workers_import_nothing_of_the_folder_that_a_bake_is_started_in(monkeypatch, tmp_path):
    """As of another checkout, whose workers would be refused."""
    (tmp_path / "engine").mkdir()
    (tmp_path / "engine" / "__init__.py").write_text("raise SystemExit(3)")
    monkeypatch.chdir(tmp_path)
    with cluster(1) as made:
        assert [*made.client.run(admission.refusal, admission.source_digest()).values()] == [""]


@pytest.mark.long
def test_the_report_names_who_is_refused_while_others_work(by_two):
    with cluster(1) as made:
        made.add({local_workers.DEVICE: "Platform: Voodoo 2"})
        made.client.wait_for_workers(2, timeout=60)
        lightmap = baked(made)
    (told,) = lightmap.report.warnings
    assert told.startswith("Worker 'tcp://") and "There is no OpenCL device 'Platform: Voodoo 2'" in told
    assert any("1 Dask worker computes" in reason for reason in lightmap.report.reasons)
    assert np.array_equal(lightmap.image, by_two.image)


def test_a_scene_that_leaves_the_machine_in_the_clear_is_told(monkeypatch, two, by_two):
    monkeypatch.setattr("engine.cluster.connection.is_of_this_machine", lambda _: False)
    lightmap = baked(two)
    (told,) = lightmap.report.warnings
    assert told.startswith("Scheduler tcp://") and "not encrypted" in told and "tls://" in told
    assert not any("not encrypted" in warning for warning in by_two.report.warnings)
    assert np.array_equal(lightmap.image, by_two.image)


def test_worker_without_its_device_is_refused_by_name():
    made = local_workers.LocalWorkers([{local_workers.DEVICE: "Platform: Voodoo 2"}])
    try:
        with pytest.raises(DeviceError, match="There is no OpenCL device 'Platform: Voodoo 2'"):
            baked(made)
    finally:
        made.close()


def test_a_thread_that_starts_late_is_waited_for(monkeypatch, two):
    """On a machine that is busy with other things Dask gives its thread up after 10 s."""
    start, tries = LoopRunner.start, itertools.count(1)

    def start_late(runner):
        assert next(tries) > 2
        start(runner)

    monkeypatch.setattr(LoopRunner, "start", start_late)
    assert baked(two).report.converged


def test_a_thread_that_never_starts_is_an_error_with_the_remedy(monkeypatch, two):
    def start_never(runner):
        raise AssertionError

    monkeypatch.setattr(LoopRunner, "start", start_never)
    with pytest.raises(DeviceError, match="too busy.*without a scheduler"):
        baked(two)


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense", "udp://127.0.0.1:8786"])
def test_scheduler_that_is_not_there_is_an_error_with_the_remedy(address):
    began = time.monotonic()
    with pytest.raises(DeviceError, match="No Dask scheduler answers.*dask scheduler"):
        finished(Session().bake(nine_quad_room(), replace(SETTINGS, scheduler=address)))
    assert time.monotonic() - began < local_workers.ANSWER / 2


def test_something_else_that_listens_is_no_scheduler(monkeypatch):
    monkeypatch.setattr("engine.cluster.connection.ANSWER", 1)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(DeviceError, match="No Dask scheduler answers.*dask scheduler"):
            finished(Session().bake(nine_quad_room(), replace(SETTINGS, scheduler=address)))


def test_charts_that_overlap_are_named_though_workers_do_not_look_for_them(two, by_two):
    room = nine_quad_room()
    twice = replace(room, meshes=(*room.meshes, replace(room.meshes[0], name="Again")))
    with pytest.raises(OverlapError, match="Again"):
        baked(two, scene=twice)
    assert np.array_equal(baked(two).image, by_two.image)


def test_what_workers_do_not_do_is_refused(two):
    with pytest.raises(SettingsError, match="Workers support neither light groups"):
        baked(two, replace(SETTINGS, method="paper"))


def test_without_dask_the_remedy_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "engine.cluster.workers", None)
    with pytest.raises(DeviceError, match="Install it, or leave the scheduler empty"):
        finished(Session().bake(nine_quad_room(), replace(SETTINGS, scheduler="all")))
