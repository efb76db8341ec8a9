"""Devices are found, distinguished and chosen by name; missing parts are reported."""

import dataclasses
import os

import pytest

from engine import DeviceError, Settings, finished
from engine.device import cl_device, driver_options, survey
from engine.device.cl_device import ComputeDevice, device_name, found_devices
from engine.session import Session, find_devices
from engine.worker.worker import Worker
from tests.analytic.scenes import furnace


def test_every_device_is_listed_once_and_the_one_of_a_bake_is_marked():
    found = survey.survey(None)
    opengl, *opencl = found.devices
    names = [device.name for device in opencl]
    assert opengl.api == "OpenGL" and opengl.use == "drawing hemicubes" and opengl.driver
    assert sorted(names) == sorted({device_name(device) for device in found_devices()})
    (used,) = [device for device in opencl if device.use]
    assert used.name == device_name(ComputeDevice().device) and used.memory > 1 << 28 and not used.issue
    assert not found.missing


def test_the_worker_finds_the_same_devices_and_keeps_them_out_of_this_process():
    """But for their memory: PoCL tells what is free at the moment."""
    worker = Worker(bake="engine.session:find_devices")
    try:
        found = [finished(worker.run(None)), survey.survey(None), finished(find_devices(None))]
        first, *others = [
            [dataclasses.replace(device, memory=0) for device in each.devices] for each in found
        ]
        assert all(each == first for each in others)
        assert not any(each.missing for each in found)
    finally:
        worker.stop()


class Platform:
    def __init__(self, name, version):
        self.name, self.version, self.vendor = name, version, "Nobody"


class Device:
    """Fake device of another machine."""

    def __init__(self, platform, name, kind, works=True):
        self.platform, self.name, self.type, self.works = platform, name, kind, works
        self.driver_version, self.global_mem_size = "1.0 ", 3 << 30
        self.vendor, self.version = "Nobody", "OpenCL 3.0"


@pytest.fixture
def workstation(monkeypatch):
    """A processor by two versions of PoCL, of which the first builds nothing, beside two graphics cards."""
    old, new = (
        Platform("Portable Computing Language", "PoCL 3.0"),
        Platform("Portable Computing Language ", "PoCL 6.0"),
    )
    card = Platform("CUDA", "OpenCL 3.0")
    kinds = cl_device.cl.device_type
    devices = [
        Device(card, "Card A ", kinds.GPU),
        Device(card, "Card B", kinds.GPU),
        Device(old, "cpu", kinds.CPU, works=False),
        Device(new, "cpu ", kinds.CPU),
    ]

    def needed_replacements(context):
        if not context.devices[0].works:
            raise cl_device.cl.RuntimeError("error: unknown target CPU 'generic'")
        return ()

    for module in (cl_device, survey):
        monkeypatch.setattr(module, "found_devices", lambda: devices)
    monkeypatch.setattr(cl_device, "needed_replacements", needed_replacements)
    monkeypatch.setattr(cl_device.cl, "Context", lambda devices: type("Context", (), {"devices": devices})())
    monkeypatch.setattr(cl_device.cl, "CommandQueue", lambda context: None)
    return devices


@pytest.mark.parametrize(
    ("name", "index"),
    [(None, 0), ("CUDA: Card B", 1), ("Portable Computing Language: cpu", 3)],
)
def test_chosen_device_is_taken_and_the_one_that_works_of_those_with_its_name(workstation, name, index):
    assert ComputeDevice(opencl_device=name).device is workstation[index]


def test_device_that_two_platforms_offer_is_listed_once_as_the_one_that_works(workstation):
    found = survey.survey("CUDA: Card B")
    cards = found.devices[1:]
    assert [device.name for device in cards] == [
        "CUDA: Card A",
        "CUDA: Card B",
        "Portable Computing Language: cpu",
    ]
    assert [bool(device.use) for device in cards] == [False, True, False]
    assert not any(device.issue for device in cards)
    assert cards[2].driver == "1.0" and cards[2].memory == 3 << 30


def test_device_that_cannot_build_kernels_says_why(workstation):
    workstation[3].works = False
    *_, processor = survey.survey(None).devices
    assert processor.issue == "error: unknown target CPU 'generic'" and not processor.use


def test_device_whose_driver_lacks_functions_does_not_count(monkeypatch):
    """As llvmpipe of Mesa 26.2 answers beside a libclc that is not Mesa's, here for a function without a
    replacement."""
    answer = """clBuildProgram failed: BUILD_PROGRAM_FAILURE - clBuildProgram failed: BUILD_PROGRAM_FAILURE

Build on <pyopencl.Device 'llvmpipe' on 'rusticl' at 0x1>:

Internal compilation error: nir_shader not fully linked
(options: -I .)"""

    def build(context, source, options=()):
        if "atan2(" in source:
            raise cl_device.cl.RuntimeError(answer)

    monkeypatch.setattr(driver_options, "build", build)
    with pytest.raises(DeviceError, match="Internal compilation error: nir_shader not fully linked"):
        ComputeDevice()


@pytest.mark.parametrize("own", [None, "8"])
def test_drivers_are_asked_for_what_works_unless_the_user_says_otherwise(own, monkeypatch):
    name = "CL_CONFIG_CPU_VECTORIZER_MODE"
    monkeypatch.delenv(name, raising=False)
    if own is not None:
        monkeypatch.setenv(name, own)
    assert cl_device.found_devices() and os.environ[name] == (own or "1")


def test_device_that_is_not_there_is_told_with_those_that_are(workstation):
    with pytest.raises(
        DeviceError, match="no OpenCL device 'Card C'. Choose one of 'CUDA: Card A', 'CUDA: Card B', 'P"
    ):
        ComputeDevice(opencl_device="Card C")
    assert "'Card C'" in survey.survey("Card C").missing[0]


def test_without_opencl_opengl_sums_and_the_remedy_is_told(monkeypatch):
    def none():
        raise DeviceError("There is no OpenCL device. Install one.")

    monkeypatch.setattr(survey, "found_devices", none)
    found = survey.survey(None)
    (opengl,) = found.devices
    assert opengl.use == "casting rays and summing light"
    assert found.missing == ("There is no OpenCL device. Install one.",)


def test_a_bake_never_goes_to_another_device_than_the_chosen_one():
    session, settings = Session(), Settings(resolution=32, hemicube=8)
    with pytest.raises(DeviceError, match="no OpenCL device 'Card C'"):
        finished(session.bake(furnace(0.5, 1.0), dataclasses.replace(settings, opencl_device="Card C")))
    name = device_name(ComputeDevice().device)
    chosen = dataclasses.replace(settings, opencl_device=name)
    assert finished(session.bake(furnace(0.5, 1.0), chosen)).report.devices["cl"] in name
    session.close()
