"""The wrapper of Open Image Denoise, with fake libraries that fail and with the real library."""

import ctypes
import sys
from pathlib import Path

import numpy as np
import pytest

from engine.denoise import found
from engine.denoise.library import DenoiseDevice, DenoiseLibrary
from engine.errors import DenoiseError
from tests.tools.real_denoiser import LIBRARY, needs_library

#: A file name of the library, on this system.
NAME = {"win32": "OpenImageDenoise.dll", "darwin": "libOpenImageDenoise.2.dylib"}.get(
    sys.platform, "libOpenImageDenoise.so.2"
)


class FakeLibrary:
    """Has all functions; `errors` are what each makes the device report, `made` what is not released."""

    def __init__(self, version=20303, device=7, errors=()):
        self.answers = {"oidnGetDeviceInt": version, "oidnNewDevice": device}
        self.errors, self.failed, self.made = dict(errors), None, []

    def __getattr__(self, name):
        if not name.startswith("oidn"):
            raise AttributeError(name)

        def function(*arguments):
            self.failed = self.errors.get(name, self.failed)
            if name == "oidnGetDeviceError":
                return self._tell(arguments[1])
            if name.startswith("oidnNew"):
                self.made += [name[7:]]
                return self.answers.get(name, 7)
            if name.startswith("oidnRelease"):
                self.made.remove(name[11:])
            return self.answers.get(name)

        setattr(self, name, function)
        return function

    def _tell(self, message):
        text, self.failed = self.failed, None
        message._obj.value = text
        return 4 if text else 0


@pytest.fixture
def library(monkeypatch):
    """Return a function that makes a library of a fake one."""

    def make(fake):
        monkeypatch.setattr(ctypes, "CDLL", lambda path: fake)
        return DenoiseLibrary(Path("somewhere") / NAME)

    return make


def test_file_that_is_no_library_is_named_with_the_remedy(tmp_path):
    (tmp_path / NAME).write_bytes(b"no library")
    with pytest.raises(DenoiseError, match=r"cannot be loaded from .*pyoidn"):
        DenoiseLibrary(tmp_path / NAME)


def test_library_without_the_functions_of_version_2_is_no_library(library):
    class Old(FakeLibrary):
        def __getattr__(self, name):
            if name == "oidnWriteBuffer":
                raise AttributeError("undefined symbol: oidnWriteBuffer")
            return super().__getattr__(name)

    with pytest.raises(DenoiseError, match="undefined symbol: oidnWriteBuffer"):
        library(Old())


@pytest.mark.parametrize("version", [10404, 30000])
def test_another_major_version_is_refused_and_its_device_released(library, version):
    fake = FakeLibrary(version)
    with pytest.raises(DenoiseError, match=f"version {version // 10000}.*needs version 2"):
        DenoiseDevice(library(fake), "cpu")
    assert fake.made == []


def test_device_that_is_not_there_is_named_with_its_reason(library):
    fake = FakeLibrary(device=None, errors={"oidnNewDevice": b"unsupported device type: CUDA"})
    with pytest.raises(DenoiseError, match="type CUDA: unsupported device type: CUDA"):
        DenoiseDevice(library(fake), "cuda")


@pytest.mark.parametrize(
    ("function", "doing"),
    [
        ("oidnNewBuffer", "taking memory for 5 x 3 pixels"),
        ("oidnCommitFilter", "preparing its filter"),
        ("oidnExecuteFilter", "filtering"),
    ],
)
def test_failure_says_what_was_done_and_leaves_nothing_behind(library, function, doing):
    fake = FakeLibrary(errors={function: b"out of memory"})
    device = DenoiseDevice(library(fake), "cpu")
    with pytest.raises(DenoiseError, match=f"{doing}: out of memory"):
        device.filtered(np.ones((3, 5, 3), np.float32))
    device.release()
    assert fake.made == []


def test_images_of_one_size_share_a_filter(library):
    fake = FakeLibrary()
    device = DenoiseDevice(library(fake), "cpu")
    for shape in ((3, 5, 3), (3, 5, 3), (7, 5, 3)):
        device.filtered(np.ones(shape, np.float32))
        assert sorted(fake.made) == ["Buffer", "Device", "Filter"]
    device.release()
    assert fake.made == []


@pytest.mark.parametrize("folder", ["lib", "blender.shared", "."])
def test_library_of_a_blender_lies_in_its_folder_of_libraries(tmp_path, folder):
    assert found.library_of_blender(tmp_path) is None
    path = tmp_path / folder / NAME
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(b"")
    assert found.library_of_blender(tmp_path) == path


def test_library_of_a_package_is_found_without_importing_it(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    path = tmp_path / "pyoidn" / "oidn" / "lib" / NAME
    path.parent.mkdir(parents=True)
    path.write_bytes(b"")
    (tmp_path / "pyoidn" / "__init__.py").write_text("raise RuntimeError('imported')")
    assert found.library_of_packages() == path


@needs_library
def test_real_library_takes_most_of_the_noise_and_leaves_the_light():
    device = DenoiseDevice(DenoiseLibrary(LIBRARY), "cpu")
    random = np.random.default_rng(3)
    light = np.linspace(0.1, 0.6, 3 * 83 * 97, dtype=np.float32).reshape(83, 97, 3)
    noise = random.normal(0, 0.04, light.shape).astype(np.float32)
    quiet = device.filtered(light + noise)
    assert device.name.startswith("Open Image Denoise 2.") and device.name.endswith("(CPU)")
    device.release()
    assert np.sqrt(np.mean((quiet - light) ** 2)) < 0.01
    assert abs(quiet.mean() / light.mean() - 1) < 0.01


@needs_library
def test_real_library_tells_that_a_card_is_not_there():
    with pytest.raises(DenoiseError, match="METAL" if sys.platform != "darwin" else "CUDA"):
        DenoiseDevice(DenoiseLibrary(LIBRARY), "metal" if sys.platform != "darwin" else "cuda")
