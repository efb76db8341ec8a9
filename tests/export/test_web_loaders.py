"""Pixels of Babylon.js and PlayCanvas in Chromium against Blender's preview, with light states."""

import pytest

from tests.export.states import WIDTH, changed, close_enough
from tools.engines import cornell, room
from tools.engines.web import BABYLON, PLAYCANVAS, THREE


@pytest.fixture(params=[BABYLON, PLAYCANVAS], ids=lambda engine: engine.module)
def loader(request):
    if missing := request.param.missing():
        pytest.skip(f"{missing}: exports are not shown with {request.param.package}")
    request.param.install()
    return request.param


@pytest.mark.parametrize("state", ["", *cornell.STATES])
def test_the_loader_shows_light_states(stateful, loader, tmp_path, state):
    """With the maps in the file alone; without a state the light is that of all groups."""
    folder, wanted = stateful
    path = tmp_path / "room.glb"
    path.write_bytes((folder / "room.glb").read_bytes())
    seconds = 0.2 if state == "Night" else 0.0
    shown = loader.show(path, WIDTH, WIDTH, cornell.HIDDEN, state=state, seconds=seconds)
    assert shown.problems == []
    close_enough(shown.pixels, wanted[state or "Day"])


@pytest.fixture(scope="module")
def furnished(hemibake, tmp_path_factory):
    """Return an export with two lightmaps and instances, and the preview."""
    import bpy

    room.bake()
    folder = tmp_path_factory.mktemp("room")
    wanted = cornell.preview(WIDTH, folder)
    bpy.ops.hemibake.export_for_engine(filepath=str(folder / "room.glb"))
    return folder / "room.glb", wanted


@pytest.mark.parametrize("engine", [THREE, BABYLON, PLAYCANVAS], ids=lambda engine: engine.module)
def test_loaders_show_instances_and_lightmaps_of_two_sizes(furnished, engine):
    if missing := engine.missing():
        pytest.skip(f"{missing}: exports are not shown with {engine.package}")
    engine.install()
    path, wanted = furnished
    shown = engine.show(path, WIDTH, WIDTH, cornell.HIDDEN)
    assert shown.problems == []
    close_enough(shown.pixels, wanted)


@pytest.mark.parametrize("kind", ["hdr", "rgbm"])
def test_the_loader_reads_files_of_bakes(hemibake, loader, tmp_path, kind):
    import bpy

    cornell.bake(64, "preview", states=True, file_format=kind, folder=tmp_path)
    bpy.ops.hemibake.light_state_apply(name="Night")
    wanted = cornell.preview(WIDTH, tmp_path)
    path = tmp_path / "room.glb"
    bpy.ops.hemibake.export_for_engine(filepath=str(path), lightmaps="NONE", use_files=False)
    if loader is BABYLON and kind != "hdr":
        (problem, *_) = loader.show(path, 8, 8).problems
        assert "this loader reads no PNG" in problem
        return
    shown = loader.show(path, WIDTH, WIDTH, cornell.HIDDEN, state="Night")
    assert shown.problems == []
    assert (cornell.differences(shown.pixels, wanted) > 0.03).mean() < 0.02


def test_the_loader_names_what_is_missing(stateful, loader, tmp_path):
    folder, wanted = stateful
    path = changed(tmp_path, folder / "room.glb", lambda manifest: manifest.update(version=9))
    shown = loader.show(path, WIDTH, WIDTH, cornell.HIDDEN, state="Night")
    assert ["hemibake.json: version 9 is unknown" in problem for problem in shown.problems] == [True]
    close_enough(shown.pixels, wanted["Night"])
    with pytest.raises(
        RuntimeError, match="Light state 'Noon': not in the file. Choose one of: 'Day', 'Night'"
    ):
        loader.show(path, 8, 8, state="Noon")
