"""The Self-Test operator: in background at once, in a window modal over the worker; and its log."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.blender.test_modal import ESCAPE, TIMER, Window, context, drive, stand_in_for, window  # noqa: F401
from tests.blender.things import furnace, part, snapshot
from tools.headless import disable, enable


def told():
    last = part("operators.self_test").last_test
    return last.right, last.text


@pytest.fixture(autouse=True)
def log(empty_scene):
    """The path of the log, which is empty."""
    path = part("operators.user_files").log_file()
    path.unlink(missing_ok=True)
    return path


@pytest.fixture
def operator():
    return stand_in_for(part("operators.self_test").HEMIBAKE_OT_self_test)


def test_machine_that_works_is_right_and_nothing_changes(log):
    import bpy

    furnace()
    before = snapshot()
    assert bpy.ops.hemibake.self_test() == {"FINISHED"}
    right, text = told()
    assert right and text.startswith("Passed: the light differs by 0.") and "llvmpipe" in text
    assert snapshot() == before and "Self-test: Passed: " in log.read_text()


def test_window_goes_on_meanwhile(operator, context, window):  # noqa: F811
    owner = part("operators.worker_manager").owner
    assert operator.invoke(context, None) == {"RUNNING_MODAL"}
    assert told() == (None, "Testing …")
    assert owner.busy and operator.modal(context, SimpleNamespace(type="MOUSEMOVE", value="")) == {
        "PASS_THROUGH"
    }
    assert drive(operator, context) == {"FINISHED"}, operator.reports
    assert window.is_as_before() and not owner.busy
    assert operator.reports[-1][0] == {"INFO"} and operator.reports[-1][1].startswith("Passed: ")


@pytest.mark.parametrize("way", ["escape", "disable"])
def test_test_that_is_cancelled_leaves_nothing(operator, context, window, way):  # noqa: F811
    operator.invoke(context, None)
    drive(operator, context, until=lambda: part("operators.worker_manager").owner.worker().alive)
    if way == "escape":
        assert operator.modal(context, ESCAPE) == {"CANCELLED"}
    else:
        disable()
        enable()
    assert window.is_as_before() and not part("operators.worker_manager").owner.busy
    assert told() == (None, "")


def test_dead_worker_is_told_with_what_to_do(operator, context, window, log):  # noqa: F811
    owner = part("operators.worker_manager").owner
    operator.invoke(context, None)
    drive(operator, context, until=lambda: owner.worker().alive)
    owner.worker().process.kill()
    assert drive(operator, context) == {"CANCELLED"}
    kind, text = operator.reports[-1]
    assert kind == {"ERROR"} and "The baking process" in text and window.is_as_before()
    assert told()[0] is False and "The baking process" in log.read_text()


def missing_package(scene, settings):
    raise part("engine.errors").DeviceError("The Python package 'moderngl' cannot be imported. Install it.")
    yield


def wrong_light(scene, settings):
    light = np.full((1, 8, 8, 3), 1.5, np.float32)
    report = SimpleNamespace(devices={"gl": "Card A", "cl": "Card A"}, warnings=())
    return SimpleNamespace(image=light, has_patch=light[..., 0] > 0, report=report)
    yield


@pytest.mark.parametrize(
    ("bake", "words"),
    [
        (missing_package, "'moderngl' cannot be imported. Install it."),
        (wrong_light, "known value by 25.0%.*'Card A'.*Update"),
    ],
)
def test_what_is_wrong_is_an_error_with_the_remedy(monkeypatch, log, bake, words):
    import bpy

    monkeypatch.setattr(part("operators.worker_manager").owner, "bake", lambda: bake)
    with pytest.raises(RuntimeError, match=words):
        bpy.ops.hemibake.self_test()
    right, text = told()
    assert right is False and text in log.read_text()


def test_without_opencl_it_is_right_and_says_what_is_missing(monkeypatch):
    import bpy

    def none(*chosen, ahead=()):
        raise part("engine.errors").DeviceError("There is no OpenCL device. Install one.")

    part("engine.session").close()
    import_devices = part("engine.device.devices")
    monkeypatch.setattr(import_devices, "ComputeDevice", none)
    try:
        assert bpy.ops.hemibake.self_test() == {"FINISHED"}
    finally:
        part("engine.session").close()
    right, text = told()
    assert right and "There is no OpenCL device. Install one." in text.splitlines()[1]


def test_log_has_bakes_and_what_went_wrong_and_is_cut(log):
    import bpy

    files = part("operators.user_files")
    with pytest.raises(RuntimeError):
        bpy.ops.hemibake.bake()
    furnace()
    bpy.ops.hemibake.bake()
    text = log.read_text()
    assert text.index("has no mesh with faces") < text.index("Baked 1 object,") < text.index("llvmpipe")
    files.append_to_log("x" * (1 << 20))
    files.append_to_log("new\n")
    assert log.read_text() == "new\n" and log.with_suffix(".old.log").read_text().startswith(text)


def test_what_the_worker_prints_goes_into_the_log_once(operator, context, window, log, monkeypatch):  # noqa: F811
    owner = part("operators.worker_manager").owner
    operator.invoke(context, None)
    drive(operator, context)
    process = owner.worker()._child
    for line in (b"driver warning\n", b"another\n"):
        process._log.write(line)
        part("operators.log").log("Next.")
    text = log.read_text()
    assert text.count("The worker printed: driver warning") == text.count("The worker printed: another") == 1
