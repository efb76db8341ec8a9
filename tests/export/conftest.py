"""Blender with Hemibake enabled, and engines that display its exports."""

from collections.abc import Iterator

import pytest

from tests.export.states import WIDTH
from tools.engines import cornell
from tools.engines.web import THREE
from tools.headless import blender


@pytest.fixture(scope="session")
def engine():
    """Return a renderer of exported files with three.js."""
    missing = THREE.missing()
    if missing:
        pytest.skip(f"{missing}: exports are not shown with three.js")
    THREE.install()
    return THREE


@pytest.fixture(scope="session")
def hemibake() -> Iterator[None]:
    with blender():
        yield


@pytest.fixture(scope="session")
def stateful(hemibake, tmp_path_factory):
    """Return a folder with an export of the box with light states, and the preview of each state."""
    folder = tmp_path_factory.mktemp("states")
    return folder, cornell.export_states(folder, WIDTH)
