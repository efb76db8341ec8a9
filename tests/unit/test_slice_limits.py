"""Limits of slices by device, and displays that may depend on one."""

from types import SimpleNamespace

import pyopencl as cl
import pytest

from engine.device import slice_limits as limits_of
from engine.device.slice_limits import has_window_system, is_data_center_card, may_have_display, slice_limits


def device(kind, units=37, name="A card"):
    return SimpleNamespace(type=kind, max_compute_units=units, name=name)


@pytest.fixture
def root(tmp_path):
    return tmp_path


@pytest.mark.parametrize(
    "name",
    ["NVIDIA H100 80GB HBM3", "NVIDIA H200", "Tesla V100-SXM2-16GB", "NVIDIA A100-PCIE-40GB", "NVIDIA L4",
     "gfx90a:sramecc+", "AMD Instinct MI250X", "Intel(R) Data Center GPU Max 1550"],
)  # fmt: skip
def test_data_center_cards_have_no_display(name):
    assert is_data_center_card(name)
    assert not may_have_display(device(cl.device_type.GPU, name=name))


@pytest.mark.parametrize(
    "name",
    ["NVIDIA GeForce RTX 4090", "NVIDIA RTX A4000", "NVIDIA T400 4GB", "Quadro P2000", "gfx1100", "Apple M2",
     "Intel(R) Arc(TM) A310 Graphics", "NVIDIA GeForce GT 200", "AMD Radeon RX 6800"],
)  # fmt: skip
def test_other_cards_may_have_one(name, monkeypatch):
    monkeypatch.setattr(limits_of.sys, "platform", "win32")
    assert not is_data_center_card(name)
    assert may_have_display(device(cl.device_type.GPU, name=name))


@pytest.mark.parametrize("kind", [cl.device_type.CPU, cl.device_type.ACCELERATOR])
def test_other_devices_have_none(kind, monkeypatch):
    monkeypatch.setattr(limits_of.sys, "platform", "win32")
    assert not may_have_display(device(kind))


def test_linux_without_a_window_system_has_no_display(root):
    assert not has_window_system({"DISPLAY": "", "HOME": "/"}, root)
    assert has_window_system({"WAYLAND_DISPLAY": "wayland-0"}, root)
    assert has_window_system({"DISPLAY": ":1"}, root)


def test_linux_shows_x_servers_and_monitors_of_others(root):
    connector = root / "sys/class/drm/card1-DP-3"
    connector.mkdir(parents=True)
    (connector / "status").write_text("disconnected\n")
    assert not has_window_system({}, root)
    (connector / "status").write_text("connected\n")
    assert has_window_system({}, root)
    (connector / "status").unlink()
    (root / "tmp/.X11-unix").mkdir(parents=True)
    assert not has_window_system({}, root)
    (root / "tmp/.X11-unix/X7").touch()
    assert has_window_system({}, root)


def test_the_first_slice_gives_every_compute_unit_work_and_is_far_from_full():
    card = slice_limits(device(cl.device_type.GPU, units=132, name="NVIDIA H100"), 32, 1)
    assert card.first >= 2 * card.least >= 2 * 132 * 64
    assert card.fill == 132 * 2048 and card.longest == 0.4
    groups = slice_limits(device(cl.device_type.GPU, units=132, name="NVIDIA H100"), 32, 64)
    assert groups.fill == 132 * 32 and groups.least == 132


def test_cards_with_a_display_have_shorter_slices(monkeypatch):
    monkeypatch.setattr(limits_of, "may_have_display", lambda device: True)
    assert slice_limits(device(cl.device_type.GPU), 32, 1).longest == 0.1
    assert slice_limits(device(cl.device_type.CPU), 8, 1).longest == 0.1


def test_a_processor_is_full_at_once_and_may_work_on_few_items():
    processor = slice_limits(device(cl.device_type.CPU, units=2), 8, 1)
    assert (processor.first, processor.fill, processor.least) == (256, 256, 128)
    assert slice_limits(device(cl.device_type.CPU, units=2), 8, 64).least == 2
