"""Installation without a network: install, bake, upgrade, remove."""

from fnmatch import fnmatch
from pathlib import Path
from zipfile import ZipFile

import pytest

from tests.packaging.conftest import OLDER, locked
from tools.packages.archive import MANIFEST, ROOT
from tools.packages.platforms import MISSING, PLATFORMS
from tools.packages.wheels import Wheel

#: Where Blender notes for which Python it has installed wheels, and what it forgets when it removes those
#: of a single file: what Python compiled of them.
BLENDERS_OWN = ("blender/extensions/.cache/compat.dat", "*/site-packages/__pycache__/*.pyc")


#: What sysconfig calls the platforms.
SYSCONFIG = {"linux-x64": "linux-x86_64", "windows-x64": "win-amd64", "macos-arm64": "macosx-11.00-arm64"}


def wheels_of(package: Path) -> list[str]:
    with ZipFile(package) as archive:
        return [name for name in archive.namelist() if name.endswith(".whl")]


def files_in(folder: Path) -> set[str]:
    """Return the files in a folder."""
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir()}


def is_right(lightmap: list[float]) -> bool:
    """Return whether a lightmap of the furnace is 2 wherever a surface is, and surfaces fill some of it."""
    lit = [value for value in lightmap if value != 0]
    return len(lightmap) == 3 * 32 * 32 < 8 * len(lit) and all(abs(value - 2) < 0.02 for value in lit)


def version() -> str:
    lines = (ROOT / MANIFEST).read_text(encoding="utf-8").splitlines()
    return next(line.split('"')[1] for line in lines if line.startswith("version"))


def test_blender_chooses_a_wheel_of_each_package_on_every_platform(blender, packages, user):
    targets = [(platform, python) for platform in PLATFORMS for python in platform.pythons]
    steps = [
        (
            "chosen",
            wheels_of(packages[platform.name]),
            SYSCONFIG[platform.name],
            (*map(int, python.split(".")), 0),
        )
        for platform, python in targets
    ]
    for (_, python), chosen in zip(targets, blender.run(user, *steps), strict=True):
        found = [Wheel(Path(path)).name for path in chosen]
        assert sorted(found) == sorted(set(locked()) - set(MISSING.get(python, ())))
        tag = f"cp{python.replace('.', '')}"
        assert {Wheel(Path(path)).python_tag for path in chosen} == {tag, "py3"}


def test_it_comes_and_goes_and_leaves_nothing_behind(blender, package, user):
    blender.run(user, ("nothing",))
    before = files_in(user)
    (state,) = blender.run(user, ("install", package))
    assert state == {"version": version(), "enabled": True, "warnings": {}, "online": False}
    remove(blender, user)
    assert is_blenders(files_in(user) - before)


def test_it_bakes_here_and_in_a_process_and_leaves_nothing_behind(blender, package, user, driver):
    blender.run(user, ("nothing",))
    before = files_in(user)
    steps = (("install", package), ("bake", False), ("bake", True))
    state, here, worker = blender.run(user, *steps, driver=driver)
    assert state["warnings"] == {}
    assert is_right(here["values"]) and is_right(worker["values"])
    assert here["wheels"].keys() >= {"moderngl", "glcontext", "pyopencl"}
    assert all(Path(path).is_relative_to(user) for path in here["wheels"].values())
    remove(blender, user)
    assert is_blenders(files_in(user) - before)


def remove(blender, user: Path) -> None:
    """Disable the add-on and uninstall it, in a new session."""
    state, left, _ = blender.run(user, ("enable",), ("disable",), ("uninstall",))
    assert state["warnings"] == {} and left == {"left": []}


def is_blenders(files: set[str]) -> bool:
    """Return whether all files are what Blender itself leaves."""
    return all(any(fnmatch(path, pattern) for pattern in BLENDERS_OWN) for path in files)


def test_settings_and_lightmaps_outlive_an_upgrade(blender, older_package, package, user, driver, tmp_path):
    blend = str(tmp_path / "furnace.blend")
    old, baked, _ = blender.run(
        user, ("install", older_package), ("bake", False), ("save", blend), driver=driver
    )
    assert old["version"] == OLDER and is_right(baked["values"])

    new, opened, again = blender.run(
        user, ("install", package), ("load", blend), ("bake", False), driver=driver
    )
    assert new == {"version": version(), "enabled": True, "warnings": {}, "online": False}
    assert opened["values"] == baked["values"]
    assert opened["uvs"] == ["Lightmap"]
    assert (opened["resolution"], opened["iterations"]) == (32, 7)
    assert opened["tolerance"] == pytest.approx(0.0125)
    assert is_right(again["values"])


def test_without_an_opencl_driver_it_bakes_with_opengl_and_says_so(blender, package, user, tmp_path):
    (tmp_path / "none").mkdir()
    _, baked = blender.run(user, ("install", package), ("bake", False), driver=f"{tmp_path / 'none'}/")
    assert is_right(baked["values"])
    assert any("without OpenCL" in note and "pocl-opencl-icd" in note for note in baked["warnings"])
