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
    import bpy

    cornell.bake(96, "preview", states=True)
    folder, wanted = tmp_path_factory.mktemp("states"), {}
    for name in cornell.STATES:
        bpy.ops.hemibake.light_state_apply(name=name)
        wanted[name] = cornell.preview(WIDTH, folder)
    bpy.ops.hemibake.export_for_engine(filepath=str(folder / "room.glb"))
    return folder, wanted
