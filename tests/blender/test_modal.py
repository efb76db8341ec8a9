"""The modal Bake operator, driven by events in a stand-in for a window.

Blender as a module has no windows, so the operator's own functions run on a stand-in for `self`
and for the context; all else, the worker process too, is real.
"""

from types import SimpleNamespace

import pytest

from tests.blender.things import furnace, part, pixels, snapshot

TIMER = SimpleNamespace(type="TIMER", value="NOTHING")
ESCAPE = SimpleNamespace(type="ESC", value="PRESS")
MOUSE = SimpleNamespace(type="MOUSEMOVE", value="NOTHING")


class Window:
    """What the operator does to its window is kept here."""

    def __init__(self) -> None:
        self.windows: list[object] = []
        self.timers: list[object] = []
        self.progress: list[float] | None = None
        self.handlers: list[object] = []
        self.texts: list[str | None] = []

    def event_timer_add(self, step, window):
        self.timers.append(object())
        return self.timers[-1]

    def event_timer_remove(self, timer):
        self.timers.remove(timer)

    def modal_handler_add(self, operator):
        self.handlers.append(operator)

    def progress_begin(self, low, high):
        self.progress = []

    def progress_update(self, value):
        self.progress.append(value)

    def progress_end(self):
        self.progress = None

    def status_text_set(self, text):
        self.texts.append(text)

    def is_as_before(self) -> bool:
        return not self.timers and self.progress is None and self.texts[-1] is None


@pytest.fixture
def window():
    return Window()


@pytest.fixture
def context(window):
    import bpy

    return SimpleNamespace(
        scene=bpy.context.scene,
        view_layer=bpy.context.view_layer,
        evaluated_depsgraph_get=bpy.context.evaluated_depsgraph_get,
        window=None,
        window_manager=window,
        workspace=window,
        screen=SimpleNamespace(areas=[]),
    )


@pytest.fixture
def operator():
    operator_class = part("operators.bake").HEMIBAKE_OT_bake
    functions = {name: value for name, value in vars(operator_class).items() if callable(value)}
    stand_in = type("StandIn", (), functions)()
    stand_in.reports = []
    stand_in.report = lambda kind, text: stand_in.reports.append((kind, text))
    return stand_in


def drive(operator, context, until=lambda: False) -> set[str]:
    """Send timer events until the operator ends, or until a condition holds."""
    result = {"PASS_THROUGH"}
    while result == {"PASS_THROUGH"} and not until():
        result = operator.modal(context, TIMER)
    return result


def image_shown() -> bool:
    import bpy

    return "Lightmap" in bpy.data.images


def test_bake_runs_to_its_end_between_events(operator, context, window):
    import bpy

    owner = part("operators.worker_owner").owner
    furnace()
    assert operator.invoke(context, None) == {"RUNNING_MODAL"}
    assert window.handlers == [operator] and owner.busy and not bpy.ops.hemibake.bake.poll()
    assert operator.modal(context, MOUSE) == {"PASS_THROUGH"}
    assert drive(operator, context) == {"FINISHED"}
    assert window.is_as_before() and not owner.busy
    assert any("iteration 3" in text for text in window.texts if text)
    assert operator.reports[-1][1].startswith("Baked 1 objects")
    assert pixels(bpy.data.images["Lightmap"])[..., :3].max() == pytest.approx(2, rel=0.01)


def test_escape_leaves_nothing_behind(operator, context, window):
    furnace()
    before = snapshot()
    operator.invoke(context, None)
    drive(operator, context, until=image_shown)
    assert operator.modal(context, ESCAPE) == {"CANCELLED"}
    assert window.is_as_before()
    assert snapshot() == before


def test_killed_worker_is_an_error_and_the_image_stays(operator, context, window):
    owner = part("operators.worker_owner").owner
    furnace()
    operator.invoke(context, None)
    drive(operator, context, until=image_shown)
    owner.worker().process.kill()
    assert drive(operator, context) == {"CANCELLED"}
    kind, text = operator.reports[-1]
    assert kind == {"ERROR"} and "Bake again" in text
    assert window.is_as_before() and image_shown()


def test_scene_that_cannot_be_baked_does_not_start(operator, context, window):
    assert operator.invoke(context, None) == {"CANCELLED"}
    assert operator.reports[0][0] == {"ERROR"}
    assert not window.timers and not part("operators.worker_owner").owner.busy
