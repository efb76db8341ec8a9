"""Packages of this checkout and of one that calls itself older, and the Blenders to put them into."""

import sys
from pathlib import Path

import pytest

from tests.packaging.blenders import ROOT, Blender, blender_of, installed
from tools.packages.archive import build
from tools.packages.platforms import PLATFORMS
from tools.packages.wheels import wheels_in

#: Earlier than any version that people have.
OLDER = "0.0.1"


@pytest.fixture(scope="session")
def wheels():
    found = wheels_in(ROOT / "out" / "wheels")
    assert found, "The wheels are not there: run make package."
    return found


@pytest.fixture(scope="session")
def packages(wheels, tmp_path_factory) -> dict[str, Path]:
    """Return the package of each platform."""
    return by_platform(build(wheels, tmp_path_factory.mktemp("packages")))


@pytest.fixture(scope="session")
def package(packages) -> str:
    """Return the package for this machine."""
    return str(packages[this_platform()])


@pytest.fixture(scope="session")
def older_package(wheels, tmp_path_factory) -> str:
    return str(by_platform(build(wheels, tmp_path_factory.mktemp("older"), OLDER))[this_platform()])


def by_platform(paths: list[Path]) -> dict[str, Path]:
    return {name: path for name in names() for path in paths if path.stem.endswith(name.replace("-", "_"))}


def names() -> list[str]:
    return [platform.name for platform in PLATFORMS]


def locked() -> list[str]:
    """Return the packages that come as wheels."""
    lines = (ROOT / "requirements" / "wheels.txt").read_text(encoding="utf-8").splitlines()
    return [line.partition("==")[0] for line in lines if "==" in line and not line.startswith(("#", " "))]


def this_platform() -> str:
    return next(platform.name for platform in PLATFORMS if platform.system == sys.platform)


@pytest.fixture(scope="session", params=installed())
def blender(request, tmp_path_factory) -> Blender:
    """Return each Blender of this machine."""
    return blender_of(request.param, tmp_path_factory.mktemp("blender"))


@pytest.fixture(scope="session")
def driver(tmp_path_factory) -> str | None:
    """Return a folder that names the PoCL of the tests' environment as the OpenCL driver, if it has one."""
    site = Path(sys.prefix) / "lib" / f"python3.{sys.version_info.minor}" / "site-packages"
    libraries = list((site / "pyopencl" / ".libs").glob("libpocl*"))
    if not libraries:
        return None
    folder = tmp_path_factory.mktemp("vendors")
    (folder / "pocl.icd").write_text(str(libraries[0]))
    return f"{folder}/"


@pytest.fixture
def user(tmp_path) -> Path:
    """Return an empty folder as a person's home."""
    return tmp_path / "home"
