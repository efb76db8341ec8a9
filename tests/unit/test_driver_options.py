"""Environment of OpenCL drivers: what the user has set stays, the rest follows the hardware."""

import platform

import pytest

from engine.device import driver_options
from engine.device.driver_options import mesa_drivers, set_driver_options, vendor_folder


@pytest.fixture(autouse=True)
def linux(monkeypatch):
    monkeypatch.setattr(driver_options.sys, "platform", "linux")


def add_gpu(root, card, driver):
    """Add a GPU to /sys, where the driver is a link."""
    kernel = root / "sys/bus/pci/drivers" / driver
    kernel.mkdir(parents=True, exist_ok=True)
    device = root / "sys/class/drm" / card / "device"
    device.mkdir(parents=True)
    (device / "driver").symlink_to(kernel)


def add_icd(root, folder):
    path = root / folder
    path.mkdir(parents=True)
    (path / "driver.icd").write_text("libdriver.so\n")
    return path


@pytest.mark.parametrize(
    ("kernel", "mesa"),
    [
        ((), ["llvmpipe"]),
        (("nvidia",), ["llvmpipe"]),
        (("amdgpu",), ["radeonsi"]),
        (("i915", "amdgpu", "xe"), ["iris", "radeonsi"]),
    ],
)
def test_rusticl_offers_the_gpus_of_the_machine(tmp_path, kernel, mesa):
    for index, driver in enumerate(kernel):
        add_gpu(tmp_path, f"card{index}", driver)
    assert mesa_drivers(tmp_path) == mesa
    environment = {}
    set_driver_options(environment, tmp_path)
    assert environment["RUSTICL_ENABLE"] == ",".join(mesa)
    assert "OCL_ICD_VENDORS" not in environment


def test_the_choice_of_the_user_stays(tmp_path):
    add_gpu(tmp_path, "card0", "amdgpu")
    add_icd(tmp_path, f"usr/lib/{platform.machine()}-linux-gnu/GL/OpenCL/vendors")
    chosen = {"RUSTICL_ENABLE": "", "OCL_ICD_VENDORS": "/mine", "CL_CONFIG_CPU_VECTORIZER_MODE": "4"}
    environment = dict(chosen)
    set_driver_options(environment, tmp_path)
    assert environment == chosen
    environment = {"OPENCL_VENDOR_PATH": "/mine"}
    set_driver_options(environment, tmp_path)
    assert "OCL_ICD_VENDORS" not in environment


def test_flatpak_has_its_drivers_in_extensions(tmp_path):
    base = f"usr/lib/{platform.machine()}-linux-gnu/GL"
    assert vendor_folder(tmp_path) is None
    mesa = add_icd(tmp_path, f"{base}/default/OpenCL/vendors")
    assert vendor_folder(tmp_path) == mesa
    nvidia = add_icd(tmp_path, f"{base}/nvidia-550-54/OpenCL/vendors")
    assert vendor_folder(tmp_path) == nvidia
    merged = add_icd(tmp_path, f"{base}/OpenCL/vendors")
    assert vendor_folder(tmp_path) == merged
    environment = {}
    set_driver_options(environment, tmp_path)
    assert environment["OCL_ICD_VENDORS"] == str(merged)
    add_icd(tmp_path, "etc/OpenCL/vendors")
    assert vendor_folder(tmp_path) is None
