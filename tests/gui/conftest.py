"""A window of Blender with the package of this checkout; skipped where none can be had."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tools.gui.machines import MissingError, find_machine
from tools.gui.pictures import write_picture
from tools.gui.window import Window
from tools.packages.archive import build
from tools.packages.wheels import wheels_in

ROOT = Path(__file__).parents[2]

#: Where pictures of the window are kept.
PICTURES = ROOT / "out" / "gui"


@pytest.fixture(scope="session")
def window(tmp_path_factory) -> Iterator[Window]:
    if sys.platform != "linux":
        pytest.skip("A window on a screen of its own needs Linux.")
    wheels = wheels_in(ROOT / "out" / "wheels")
    assert wheels, "The wheels are not there: run make package."
    try:
        machine = find_machine()
    except MissingError as error:
        pytest.skip(str(error))
    packages = build(wheels, tmp_path_factory.mktemp("packages"))
    (package,) = [path for path in packages if "linux" in path.name]
    with Window(machine, package) as opened:
        yield opened


@pytest.fixture(scope="session")
def keep(window):
    """Return what keeps a picture of the window, numbered in the order of the test."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    for old in PICTURES.glob("*.png"):
        old.unlink()

    def keep(name: str) -> None:
        write_picture(window.picture(), PICTURES / f"{len(list(PICTURES.glob('*.png')))} {name}.png")

    return keep
