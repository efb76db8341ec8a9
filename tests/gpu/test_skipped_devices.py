"""OpenCL devices that compute wrong light are skipped, and the report says so."""

import dataclasses

import pytest

from engine import Settings, finished, warm_up
from engine.device.cl_device import ComputeDevice, found_devices, search_devices
from engine.device.device_records import SEARCH, DeviceKey, DeviceRecords
from engine.device.devices import Devices
from engine.device.opencl import cl
from engine.errors import DeviceError
from engine.self_test import furnace
from engine.session import Session

SETTINGS = Settings(resolution=53, hemicube=8, samples=64, visibility="raster")


@pytest.fixture
def session(monkeypatch):
    made = Session()
    monkeypatch.setattr(warm_up.session, "_session", made)
    yield made
    made.close()


@pytest.fixture
def single_device(monkeypatch):
    """Hide all OpenCL devices but the first; a machine may have several drivers."""
    first = found_devices()[:1]
    monkeypatch.setattr("engine.device.cl_device.found_devices", lambda: first)


@pytest.mark.usefixtures("single_device")
@pytest.mark.parametrize(("tolerance", "right"), [(0.01, True), (-1, False)])
def test_light_is_tested_once_a_driver(session, tmp_path, monkeypatch, tolerance, right):
    settings = dataclasses.replace(SETTINGS, cache_dir=str(tmp_path))
    monkeypatch.setattr(warm_up, "TOLERANCE", tolerance)
    finished(session.bake(furnace(), settings))
    key, records = session.device, DeviceRecords(str(tmp_path))
    finished(warm_up.check_device(settings))
    assert records.is_tested(key) == right and (key.digest in records.skipped()) != right
    if right:
        assert list(warm_up.check_device(settings)) == []
        return
    report = finished(session.bake(furnace(), settings)).report
    assert "cl" not in report.devices
    assert any(f"'{key.name}': its driver computes light that is wrong" in text for text in report.warnings)
    chosen = ComputeDevice(str(tmp_path), key.name)
    assert chosen.key == key and chosen.notes == ()
    chosen.release()


def test_the_next_device_takes_over_and_the_report_names_the_skipped_one(tmp_path, monkeypatch):
    """Two devices of one name stand for two drivers."""
    device = ComputeDevice().device
    digests = iter(["bad", "good", "good"])
    monkeypatch.setattr("engine.device.cl_device.found_devices", lambda: [device, device])
    monkeypatch.setattr("engine.device.cl_device.device_digest", lambda found: next(digests, "good"))
    records = DeviceRecords(str(tmp_path))
    records.skip(ComputeDevice(str(tmp_path)).key._replace(digest="bad", name="P: Bad"), "crashed")
    digests = iter(["bad", "good"])
    compute = ComputeDevice(str(tmp_path))
    assert compute.notes == (records.skipped()["bad"],) and "'P: Bad': its driver crashed" in compute.notes[0]
    compute.release()
    digests = iter(["bad", "bad"])
    with pytest.raises(DeviceError, match="No OpenCL device works. 'P: Bad'"):
        ComputeDevice(str(tmp_path))


def test_the_error_of_the_next_device_names_the_skipped_one(tmp_path, monkeypatch):
    device = ComputeDevice().device
    digests = iter(["bad", "other"])
    monkeypatch.setattr("engine.device.cl_device.found_devices", lambda: [device, device])
    monkeypatch.setattr("engine.device.cl_device.device_digest", lambda found: next(digests, "other"))
    DeviceRecords(str(tmp_path)).skip(DeviceKey("bad", "P: Bad"), "crashed")

    def fail(context):
        raise cl.Error("no compiler")

    monkeypatch.setattr("engine.device.cl_device.needed_replacements", fail)
    with pytest.raises(DeviceError, match="'P: Bad': its driver crashed.*can build kernels.*no compiler"):
        ComputeDevice(str(tmp_path))


def test_a_crash_of_the_search_skips_all_devices_but_a_chosen_one(tmp_path):
    records, name = DeviceRecords(str(tmp_path)), ComputeDevice().key.name
    records.skip(SEARCH, "crashed")
    with pytest.raises(DeviceError, match="OpenCL driver crashed.*clear the cache"):
        ComputeDevice(str(tmp_path))
    devices = Devices(str(tmp_path))
    assert devices.compute is None and "crashed" in devices.missing
    devices.release()
    ComputeDevice(str(tmp_path), name).release()


def test_a_search_that_ends_leaves_no_record(tmp_path):
    records = DeviceRecords(str(tmp_path))
    search_devices(records, None)
    assert records.leave() is None
