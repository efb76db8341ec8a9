"""Three scenes with light states in three.js, Babylon.js, PlayCanvas, Godot and Bevy, against the preview."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from engine.scene.color import linear_to_srgb
from tests.export.states import WIDTH, close_enough
from tools.engines import bevy, cornell, godot, house, room
from tools.engines.web import BABYLON, PLAYCANVAS, THREE


class Baked(NamedTuple):
    """Exports of a scene for engines of the web, Godot and Bevy, and the preview of each state."""

    web: Path
    godot: Path
    bevy: Path
    wanted: dict[str, np.ndarray]


def bake_demo():
    cornell.bake(96, "preview", states=True)


#: Function that bakes each scene, and two of its states.
SCENES = {
    "demo": (bake_demo, ("Day", "Night")),
    "house": (house.bake, house.TIMES),
    "twins": (room.bake_twins, ("Day", "Night")),
}


@pytest.fixture(scope="module", params=SCENES)
def baked(request, hemibake, tmp_path_factory):
    import bpy

    bake, states = SCENES[request.param]
    bake()
    folder, wanted = tmp_path_factory.mktemp(request.param), {}
    for state in states:
        bpy.ops.hemibake.light_state_apply(name=state)
        wanted[state] = cornell.preview(WIDTH, folder)
    paths = []
    for engine, name in (("THREE", "web"), ("GODOT", "godot"), ("BEVY", "bevy")):
        (folder / name).mkdir()
        path = folder / name / "room.glb"
        assert bpy.ops.hemibake.export_for_engine(filepath=str(path), engine=engine) == {"FINISHED"}
        paths.append(path)
    web, for_godot, for_bevy = paths
    return Baked(web, for_godot.with_suffix(".tscn"), for_bevy, wanted)


@pytest.mark.parametrize("engine", [THREE, BABYLON, PLAYCANVAS], ids=lambda engine: engine.module)
def test_engines_of_the_web_show_each_state(baked, engine):
    if missing := engine.missing():
        pytest.skip(f"{missing}: exports are not shown with {engine.package}")
    engine.install()
    for state, wanted in baked.wanted.items():
        shown = engine.show(baked.web, WIDTH, WIDTH, cornell.HIDDEN, state=state)
        assert shown.problems == []
        close_enough(shown.pixels, wanted)


def test_bevy_shows_each_state(baked):
    if missing := bevy.missing():
        pytest.skip(f"{missing}: exports are not shown with Bevy")
    bevy.install()
    for state, wanted in baked.wanted.items():
        shown = bevy.show(baked.bevy, WIDTH, WIDTH, cornell.HIDDEN, state)
        assert shown.problems == []
        close_enough(shown.pixels, wanted)


def test_godot_shows_each_state(baked):
    """Up to two steps of Compatibility's 8 bits of sRGB and 1 %, which is 2 % of light. It clips above 1."""
    if missing := godot.missing():
        pytest.skip(f"{missing}: exports are not shown with Godot")
    for state, wanted in baked.wanted.items():
        shown = godot.render(
            baked.godot, WIDTH, WIDTH, (*cornell.HIDDEN, "Light"), state=state.replace(":", "_")
        )
        dim = wanted.max(axis=-1) < 1
        assert dim.mean() > 0.5
        off, bright = np.abs(linear_to_srgb(shown) - linear_to_srgb(wanted)), linear_to_srgb(wanted)
        assert (off.max(axis=-1) > 0.01 * bright.max(axis=-1) + 2 / 255)[dim].mean() < 0.01
