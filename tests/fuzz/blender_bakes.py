"""Runs the actions of a case on a .blend and checks that user data stays unchanged."""

from __future__ import annotations

import atexit
import json
import re
import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from tests.fuzz.blender_cases import Case
from tools.headless import blender

_blender = ExitStack()
_blender.enter_context(blender())
atexit.register(_blender.close)

import bpy  # noqa: E402

from tests.blender.things import files_below, part  # noqa: E402
from tests.fuzz.blender_files import build  # noqa: E402
from tests.fuzz.fingerprint import differences, fingerprint, unwrapped, without_results  # noqa: E402

#: Rows of a world that Blender renders: a hundredth of the usual time.
part("operators.scene.light.panorama")._ROWS = 32


def check(case: Case) -> str:
    """Do the steps of a case; return how the last one ended, raise AssertionError if something is wrong."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with tempfile.TemporaryDirectory(prefix="hemibake-fuzz-") as folder:
        build(case, Path(folder))
        user = _User(case.settings.get("uv_layer", "Lightmap"), Path(folder))
        for step in case.steps:
            end = _STEPS[step](user, case)
        if user.previewed:
            _preview(user, case)
        return end


class _User:
    """What is the user's, as it was before all steps, and whether the preview is on."""

    def __init__(self, uv_layer: str, folder: Path) -> None:
        self._uv_layer, self.folder = uv_layer, folder
        self.previewed: dict[str, Any] | None = None
        self.before = self.state()

    def state(self) -> dict[str, Any]:
        return fingerprint()

    def files(self) -> dict[str, bytes]:
        return files_below(self.folder)

    def expect_same(self, before: dict[str, Any]) -> None:
        """Raise AssertionError if anything differs from a state."""
        found = list(differences(before, self.state()))
        assert not found, "changed:\n" + "\n".join(found[:20])

    def expect_results_only(self, before: dict[str, Any]) -> None:
        """Raise AssertionError if more than lightmaps and lightmap UVs has been made."""
        after = self.state()
        moved = unwrapped(before, after, self._uv_layer)
        trimmed = [without_results(state, self._uv_layer, moved) for state in (before, after)]
        found = list(differences(*trimmed))
        assert not found, "changed:\n" + "\n".join(found[:20])


def _bake(user: _User, case: Case) -> str:
    before, files = user.state(), user.files()
    try:
        ended = bpy.ops.hemibake.bake()
    except RuntimeError as error:
        message = str(error)
        _check_message(message)
        user.expect_same(before)
        assert user.files() == files
        return _refused(message)
    assert ended == {"FINISHED"}
    user.expect_results_only(before)
    _check_report()
    return "baked"


def _unwrap(user: _User, case: Case) -> str:
    before = user.state()
    try:
        bpy.ops.hemibake.unwrap()
    except RuntimeError as error:
        _check_message(str(error))
        user.expect_same(before)
        return _refused(str(error))
    user.expect_results_only(before)
    return "unwrapped"


def _preview(user: _User, case: Case) -> str:
    before = user.state()
    try:
        bpy.ops.hemibake.preview()
    except RuntimeError as error:
        _check_message(str(error))
        user.expect_same(before)
        return _refused(str(error))
    if user.previewed is None:
        user.previewed = before
        return "preview shown"
    user.expect_results_only(user.previewed)
    user.previewed = None
    return "preview hidden"


def _cancel(user: _User, case: Case) -> str:
    """Cancel a bake after a few slices, as the window does."""
    before, files = user.state(), user.files()
    run, ending = part("operators.bake_run").BakeRun(bpy.context, part("engine").bake), "cancelled"
    try:
        for _ in range(case.slices):
            run.step()
    except StopIteration:
        pass
    except part("engine.errors").EngineError as error:
        _check_message(str(error))
        ending = _refused(str(error))
    run.cancel()
    user.expect_same(before)
    assert user.files() == files
    return ending


def _save(user: _User, case: Case) -> str:
    path = bpy.data.filepath or str(user.folder / "later.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    if user.previewed:
        user.previewed["file"] = path
    return "saved"


def _undo_push(user: _User, case: Case) -> str:
    bpy.ops.ed.undo_push(message="Fuzz")
    return "pushed"


_STEPS = {
    "bake": _bake,
    "unwrap": _unwrap,
    "preview": _preview,
    "cancel": _cancel,
    "save": _save,
    "undo push": _undo_push,
}


def _refused(message: str) -> str:
    """Return how a step ended, without names and numbers."""
    return "refused: " + re.sub(r"'[^']*'|[0-9.,]+", "_", message.strip())[:70]


def _check_message(message: str) -> None:
    """Check that an error is one for people."""
    assert "Traceback" not in message, message
    assert message.strip().endswith("."), message
    assert len(message.split()) > 5, message


def _check_report() -> None:
    """Check that the report is plain JSON and all light is finite."""
    report = json.loads(bpy.context.scene.hemibake.report, parse_constant=_not_json)
    assert report["patches"] > 0 and report["objects"] + report["instances"] > 0
    for name in report["images"]:
        pixels = part("operators.result.images")._pixels(bpy.data.images[name])
        assert len(pixels) and pixels.min() >= 0 and pixels.max() < float("inf"), name


def _not_json(word: str) -> None:
    raise AssertionError(f"The report has {word} in it.")
