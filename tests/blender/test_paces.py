"""Paces of stages are stored across sessions, so that the first percentage is smooth."""

import contextlib
import json
import math

import pytest

from tests.blender.things import furnace, part

pytestmark = pytest.mark.one_version


def paces_file():
    return part("operators.user_files")._paces_file()


def test_paces_of_a_bake_are_there_on_another_day():
    import bpy

    furnace()
    bpy.ops.hemibake.bake()
    known = json.loads(paces_file().read_text())
    assert known["Saving"] > 0 and known == part("operators.worker_manager").owner.paces
    assert part("operators.user_files").read_paces() == known
    assert part("operators.worker_manager").WorkerManager().paces == known


def test_file_of_paces_that_is_broken_is_as_none():
    files = part("operators.user_files")
    for text in ("", "{", "[]", '{"Direct light": "fast"}', "\x00"):
        paces_file().write_text(text)
        assert files.read_paces() == {}
    paces_file().write_text('{"Direct light": 2e-7, "Bounces": -1, "Visibility": NaN}')
    assert files.read_paces() == {"Direct light": 2e-7}
    paces_file().unlink()
    assert files.read_paces() == {}


def test_session_takes_the_paces_of_another_one_where_it_has_none():
    session = part("engine.session").Session()
    session._paces = {"Visibility rays": 1.0}
    work = session._bake_checked(None, None, {"Visibility rays": 2.0, "Direct light": 3.0})
    with contextlib.suppress(AttributeError):
        next(work)
    assert session._paces == {"Visibility rays": 1.0, "Direct light": 3.0}


def test_guess_of_a_whole_bake_follows_its_size():
    stages, model = part("operators.run_stages"), part("engine.scene.model")
    engine = part("engine.settings")
    scene = model.Scene((), (), ("A",), None)
    seconds = []
    for resolution in (256, 1024):
        run = stages.RunStages({})
        run.expect(scene, engine.Settings(resolution=resolution), 1)
        seconds.append(run.baking.pace)
    assert all(map(math.isfinite, seconds)) and seconds[1] > 5 * seconds[0] > 0


def steps_until(run, stage):
    """Yield after each step of a run before a stage begins."""
    while (progress := run.step()) is None or progress.stage != stage:
        yield


def test_time_of_a_bake_is_foreseen_before_the_scene_is_read():
    """By its size, as when it is known exactly: the percentage is even from the first step on."""
    import bpy

    furnace()
    foreseen, known = [], []
    for resolution in (32, 256):
        bpy.context.scene.hemibake.resolution = resolution
        run = part("operators.bake_run").BakeRun(bpy.context, part("engine").bake)
        for _ in steps_until(run, "Reading objects"):
            pass
        foreseen.append(run._stages.baking.pace)
        for _ in steps_until(run, "Starting"):
            pass
        known.append(run._stages.baking.pace)
        run.cancel()
    assert foreseen[1] > 2 * foreseen[0] and foreseen == pytest.approx(known, rel=0.3)
