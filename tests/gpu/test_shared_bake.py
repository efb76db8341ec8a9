"""Bakes that several devices of one process share; here two contexts of one device."""

from __future__ import annotations

import threading
import time
from collections.abc import Generator
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np
import pytest

from benchmarks.rooms import hilly_room
from engine import Light, Settings, finished
from engine.bake_result import BakeResult
from engine.bake_state import BakeState
from engine.device import peers
from engine.device.cl_device import ComputeDevice
from engine.device.device_array import DeviceArray
from engine.device.opencl import cl
from engine.device.row_range import RowRange
from engine.direct import shadow_rays
from engine.errors import DeviceError
from engine.gather import visibility_cache
from engine.plan import memory, sharing
from engine.plan.solve_job import SolveJob
from engine.scene.model import Scene
from engine.session import Session
from engine.settings import ALL_DEVICES
from engine.visibility import sample_counts
from engine.visibility.rays import ray_scene
from engine.visibility.rays.early_hits import EarlyHits
from engine.visibility.rays.ray_sampler import RaySampler
from engine.visibility.sample_counts import sample_bytes
from engine.visibility.sampler import VisibilityBuffers

#: An odd width, so that devices share rows unevenly.
_WIDTH = 45

_SETTINGS = Settings(
    resolution=_WIDTH, samples=64, visibility="rays", intermediates=False, adaptive=False, light_samples=8
)


#: Event of each range of rows, set once the other device has taken rows.
_begun = WeakKeyDictionary[RowRange, threading.Event]()
_take, _stop = RowRange.take, RowRange.stop


def _waiting_take(rows: RowRange, wanted: int, least: int, from_end: bool = False) -> tuple[int, int] | None:
    """Let the first device wait until the other one takes rows, since it may be done before."""
    begun = _begun.setdefault(rows, threading.Event())
    if not from_end and rows._takers > 1 and rows.left:
        begun.wait(30)
    taken = _take(rows, wanted, least, from_end)
    if from_end:
        begun.set()
    return taken


def _waking_stop(rows: RowRange) -> None:
    """Wake the first device after an error of the other one."""
    _begun.setdefault(rows, threading.Event()).set()
    _stop(rows)


@pytest.fixture
def two_devices(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a second context of the device count as another device, for small bakes too."""
    monkeypatch.setattr(peers, "equal_devices", lambda device: [device])
    monkeypatch.setattr(sharing, "_FEWEST_RAYS", 1)
    monkeypatch.setattr(sharing, "_FEWEST_OF_GROUPS", 1)
    monkeypatch.setattr(shadow_rays, "_FEWEST_SHARED", 1)
    monkeypatch.setattr(visibility_cache, "_FEWEST", 50)
    monkeypatch.setattr(RowRange, "take", _waiting_take)
    monkeypatch.setattr(RowRange, "stop", _waking_stop)


def _baked(session: Session, settings: Settings, scene: Scene | None = None) -> BakeResult:
    return finished(session.bake(scene or hilly_room(_WIDTH, 200), settings))


@pytest.mark.usefixtures("two_devices")
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"method": "stream"},
        {"patch_groups": 4},
        {"samples": 1024, "resolution": 17},
        {"outputs": ("combined", "ambient_occlusion")},
    ],
    ids=lambda changes: "-".join(map(str, changes.values())) or "cached",
)
def test_bits_equal_those_of_one_device(changes: dict[str, object]) -> None:
    settings = replace(_SETTINGS, **changes)
    scene = hilly_room(settings.resolution, 200)
    alone = _baked(Session(), settings, scene)
    shared = _baked(Session(), replace(settings, scheduler=ALL_DEVICES), scene)
    assert any("2 devices" in reason for reason in shared.report.reasons)
    assert shared.report.iterations == alone.report.iterations
    for name, image in alone.passes.items():
        assert np.array_equal(image, shared.passes[name]), name


@pytest.mark.usefixtures("two_devices")
@pytest.mark.parametrize("has_memory", [True, False], ids=["hits", "no memory"])
@pytest.mark.parametrize("width", [0, 4], ids=["patches", "groups"])
def test_hits_that_another_device_traces_early_keep_the_bits(
    width: int, has_memory: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    left, traced, trace, stop = set[int](), threading.Event(), RaySampler.trace_hits, EarlyHits.stop

    def trace_or_fail(*arguments: object) -> Generator[tuple[int, int], None, None]:
        yield from trace(*arguments)
        traced.set()
        if not has_memory:
            raise cl.MemoryError("OUT_OF_RESOURCES")

    def late_stop(early: EarlyHits) -> int:
        assert traced.wait(30)
        left.add(stop(early))
        return min(left)

    monkeypatch.setattr(sample_counts, "_NARROW", 0)
    monkeypatch.setattr(RaySampler, "trace_hits", trace_or_fail)
    monkeypatch.setattr(EarlyHits, "stop", late_stop)
    scene, settings = hilly_room(_WIDTH, 200), replace(_SETTINGS, patch_groups=width)
    shared = _baked(Session(), replace(settings, scheduler=ALL_DEVICES), scene)
    assert len(left) == 1 and 0 < min(left) < _WIDTH**2
    assert np.array_equal(shared.display, _baked(Session(), settings, scene).display)


@pytest.mark.usefixtures("two_devices")
@pytest.mark.parametrize("is_dark", [True, False], ids=["dark", "directional"])
def test_bake_that_one_device_did_alone_does_not_name_two(is_dark: bool) -> None:
    scene, outputs = hilly_room(_WIDTH, 200), ("combined", "directional")
    if is_dark:
        dark = tuple(replace(made, emission=0 * made.emission) for made in scene.materials)
        scene, outputs = replace(scene, materials=dark), ("combined",)
    settings = replace(_SETTINGS, outputs=outputs)
    alone = _baked(Session(), settings, scene)
    shared = _baked(Session(), replace(settings, scheduler=ALL_DEVICES), scene)
    assert not any("2 devices" in reason for reason in shared.report.reasons)
    for name, image in alone.passes.items():
        assert np.array_equal(image, shared.passes[name]), name


@pytest.mark.usefixtures("two_devices")
@pytest.mark.parametrize("width", [0, 2], ids=["patches", "groups"])
def test_both_devices_keep_visibility_for_the_next_bake(width: int) -> None:
    scene, session = hilly_room(_WIDTH, 200), Session()
    settings = replace(_SETTINGS, scheduler=ALL_DEVICES, patch_groups=width)
    _baked(session, settings, scene)
    kept = session._kept.samples
    rows = [sum(rows.last - rows.first for rows in cache.pieces) for cache in (kept, *kept.others)]
    assert len(rows) == 2 and min(rows) > 0 and sum(rows) == kept.count
    brighter = [replace(made, emission=made.emission * 1.25) for made in scene.materials]
    relit = replace(scene, materials=tuple(brighter))
    again = _baked(session, settings, relit)
    assert any("kept from the last bake" in reason for reason in again.report.reasons)
    alone = replace(settings, scheduler="")
    assert np.array_equal(again.image, _baked(Session(), alone, relit).image)


@pytest.mark.usefixtures("two_devices")
def test_other_device_gets_triangles_and_receivers_before_it_has_work(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ready, pack = threading.Event(), ray_scene.pack_receivers

    def packed(*arguments: object) -> object:
        if threading.current_thread() is not threading.main_thread():
            ready.set()
        return pack(*arguments)

    monkeypatch.setattr(ray_scene, "pack_receivers", packed)
    work = Session().bake(hilly_room(_WIDTH, 200), replace(_SETTINGS, scheduler=ALL_DEVICES))
    while next(work).stage != "Direct light":
        pass
    assert ready.wait(30)
    work.close()


def test_light_of_a_final_gather_stays_on_the_device() -> None:
    states: list[BakeState] = []
    settings = replace(_SETTINGS, patch_groups=2)
    made = finished(Session().bake(hilly_room(_WIDTH, 200), settings, inspect=states.append))
    light = states[0].solution.light
    assert isinstance(light, DeviceArray) and "rows" not in vars(light)
    assert np.array_equal(np.asarray(light), states[0].solution.irradiance)
    assert made.image.any()


@pytest.mark.usefixtures("two_devices")
def test_light_groups_need_patch_groups_on_one_device() -> None:
    room, session = hilly_room(_WIDTH, 200), Session()
    lamp = Light(
        "Lamp", "point", np.array([1.0, 1.0, 1.5]), np.eye(3), np.float32([3, 2, 1]), light_group="L"
    )
    scene = replace(room, lights=(lamp,), light_groups=("L",))
    outputs = ("combined", "light_groups")
    settings = replace(_SETTINGS, scheduler=ALL_DEVICES, patch_groups=2, outputs=outputs)
    _baked(session, settings, scene)
    assert not session._kept.samples.others


@pytest.mark.usefixtures("two_devices")
def test_fast_device_keeps_no_more_samples_than_its_memory_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    def half_of_the_samples(job: SolveJob) -> int:
        size = _SETTINGS.samples * sample_bytes(job.count, job.patch_scene.cutouts.tinted)
        return -(-size * job.count // 2)

    def late_take(rows: RowRange, wanted: int, least: int, from_end: bool = False) -> tuple[int, int] | None:
        while from_end and 2 * rows.left > rows._count:
            time.sleep(0.01)
        return _take(rows, wanted, least, from_end)

    monkeypatch.setattr(memory, "device_budget", half_of_the_samples)
    monkeypatch.setattr(RowRange, "take", late_take)
    session = Session()
    _baked(session, replace(_SETTINGS, scheduler=ALL_DEVICES, method="cached"))
    kept = session._kept.samples
    rows = [sum(rows.last - rows.first for rows in cache.pieces) for cache in (kept, *kept.others)]
    assert sum(rows) == kept.count and max(rows) <= (kept.count + 1) // 2


@pytest.mark.usefixtures("two_devices")
def test_light_groups_after_a_shared_bake_equal_those_without() -> None:
    room, session = hilly_room(_WIDTH, 200), Session()
    lamp = Light(
        "Lamp", "point", np.array([1.0, 1.0, 1.5]), np.eye(3), np.float32([3, 2, 1]), light_group="L"
    )
    scene = replace(room, lights=(lamp,), light_groups=("L",))
    _baked(session, replace(_SETTINGS, scheduler=ALL_DEVICES), scene)
    assert session._kept.samples.others
    settings = replace(_SETTINGS, outputs=("combined", "light_groups"))
    alone = _baked(Session(), settings, scene)
    after = _baked(session, replace(settings, scheduler=ALL_DEVICES), scene)
    assert "light_group L" in alone.passes
    for name, image in alone.passes.items():
        assert np.array_equal(image, after.passes[name]), name


@pytest.mark.usefixtures("two_devices")
def test_error_of_another_device_ends_the_bake(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise DeviceError("The second device is lost.")

    first: list[ComputeDevice] = []
    sliced = ComputeDevice.slice_size

    def slice_size(compute: ComputeDevice, *arguments: object, **options: object) -> object:
        first.append(compute)
        return sliced(compute, *arguments, **options) if compute is first[0] else fail()

    monkeypatch.setattr(ComputeDevice, "slice_size", slice_size)
    with pytest.raises(DeviceError, match="second device"):
        _baked(Session(), replace(_SETTINGS, scheduler=ALL_DEVICES))


@pytest.mark.usefixtures("two_devices")
def test_cancelled_bake_stops_both_devices() -> None:
    work = Session().bake(hilly_room(_WIDTH, 200), replace(_SETTINGS, scheduler=ALL_DEVICES))
    for progress in work:
        if progress.stage == "Direct light" and progress.fraction > 0:
            break
    work.close()


@pytest.mark.usefixtures("two_devices")
def test_cancelled_bake_does_not_wait_for_a_piece_of_another_device(monkeypatch: pytest.MonkeyPatch) -> None:
    begun, whole, find = threading.Event(), threading.Event(), RaySampler.find

    def slow_find(
        sampler: RaySampler, first: int, last: int, seen: VisibilityBuffers
    ) -> Generator[float, None, None]:
        if threading.current_thread().name.startswith("peer"):
            begun.set()
            for _ in range(1000):
                time.sleep(0.01)
                yield 0.0
            whole.set()
        yield from find(sampler, first, last, seen)

    monkeypatch.setattr(RaySampler, "find", slow_find)
    work = Session().bake(hilly_room(_WIDTH, 200), replace(_SETTINGS, scheduler=ALL_DEVICES))
    for _ in work:
        if begun.is_set():
            break
    work.close()
    assert begun.is_set() and not whole.is_set()


@pytest.mark.usefixtures("two_devices")
@pytest.mark.parametrize("error", [DeviceError("No driver."), cl.MemoryError("OUT_OF_HOST_MEMORY")])
def test_device_that_does_not_open_is_skipped(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(peers, "ComputeDevice", fail)
    made = _baked(Session(), replace(_SETTINGS, scheduler=ALL_DEVICES, resolution=16, samples=16))
    assert any("does not share" in reason for reason in made.report.reasons)
    assert not any("2 devices" in reason for reason in made.report.reasons)


def test_small_bake_opens_no_other_device(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(peers, "equal_devices", lambda device: [device])
    monkeypatch.setattr(peers, "ComputeDevice", fail)
    made = _baked(Session(), replace(_SETTINGS, scheduler=ALL_DEVICES, samples=16, resolution=16))
    assert any("too few to share" in reason for reason in made.report.reasons)
