"""The modal Bake operator, driven by events in a stand-in for a window.

Blender as a module has no windows, so the operator's own functions run on a stand-in for `self`
and for the context; all else, the worker process too, is real.
"""

import itertools
import os
import shutil
import time
from types import FunctionType, SimpleNamespace

import numpy as np
import pytest

from tests.blender.test_panels import Layout
from tests.blender.things import furnace, part, pixels, report, snapshot, square
from tests.rows import long
from tools.headless import disable, enable

TIMER = SimpleNamespace(type="TIMER", value="NOTHING")
ESCAPE = SimpleNamespace(type="ESC", value="PRESS", mouse_x=399, mouse_y=100)
ESCAPE_ELSEWHERE = SimpleNamespace(type="ESC", value="PRESS", mouse_x=400, mouse_y=100)
MOUSE = SimpleNamespace(type="MOUSEMOVE", value="NOTHING")

#: Time between two events, and the longest that an operator may take, s.
BETWEEN, PATIENCE = 0.002, 600


@pytest.fixture(autouse=True)
def slow_bake(empty_scene):
    """Draw hemicubes in every iteration: a bake that is still running when it is to be cancelled."""
    import bpy

    bpy.context.scene.hemibake.method = "paper"


class Workspace:
    """Records the texts of the status bar."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def status_text_set(self, draw):
        import bpy

        assert isinstance(draw, FunctionType), "Blender would not call it"
        bpy.data.workspaces[0].status_text_set(draw)
        draw(SimpleNamespace(layout=self), bpy.context)

    def label(self, *, text, translate):
        assert not translate
        self.texts.append(text)

    def __getattr__(self, name):
        import bpy

        assert name in bpy.types.UILayout.bl_rna.functions, name
        return lambda: None


class Window:
    """Records the operator's calls on its window."""

    def __init__(self) -> None:
        self.workspaces = [Workspace(), Workspace()]
        self.windows: list[object] = []
        self.timers: list[object] = []
        self.progress: list[float] | None = None
        self.handlers: list[object] = []

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

    def is_as_before(self) -> bool:
        from bl_ui.space_statusbar import STATUSBAR_HT_header as status_bar

        return not self.timers and self.progress is None and status_bar.draw is status_bar._draw_orig


@pytest.fixture
def window(monkeypatch):
    result = Window()
    monkeypatch.setattr(part("operators.window_bake"), "_PERIODS", (0.0, 0.0))
    return result


def area(kind, x):
    """Return an area of 400 by 300 pixels."""
    return SimpleNamespace(type=kind, x=x, y=0, width=400, height=300)


@pytest.fixture
def context(window):
    import bpy

    return SimpleNamespace(
        scene=bpy.context.scene,
        view_layer=bpy.context.view_layer,
        evaluated_depsgraph_get=bpy.context.evaluated_depsgraph_get,
        window=None,
        area=None,
        window_manager=window,
        workspace=window.workspaces[0],
        screen=SimpleNamespace(areas=[area("OUTLINER", 400), area("VIEW_3D", 0)]),
    )


@pytest.fixture
def operator():
    return stand_in_for(part("operators.bake").HEMIBAKE_OT_bake)


@pytest.fixture
def unwrap_operator():
    return stand_in_for(part("operators.unwrap").HEMIBAKE_OT_unwrap)


def stand_in_for(operator_class):
    own = [cls for cls in operator_class.__mro__ if cls.__module__.startswith("bl_ext.")]
    known = {name: value for cls in reversed(own) for name, value in vars(cls).items()}
    stand_in = type("StandIn", (), {name: value for name, value in known.items() if name[:2] != "__"})()
    stand_in.reports = []
    stand_in.report = lambda kind, text: stand_in.reports.append((kind, text))
    return stand_in


def drive(operator, context, until=lambda: False) -> set[str]:
    """Send timer events until the operator ends, or until a condition holds.

    Between two of them the worker, which has the lower priority, gets the processor.
    """
    result, began = {"PASS_THROUGH"}, time.monotonic()
    while result == {"PASS_THROUGH"} and not until():
        result = operator.modal(context, TIMER)
        time.sleep(BETWEEN)
        assert time.monotonic() - began < PATIENCE, "The operator does not come to an end."
    return result


def image_shown() -> bool:
    import bpy

    return "Lightmap" in bpy.data.images


def test_bake_runs_to_its_end_between_events(operator, context, window):
    import bpy

    owner = part("operators.worker_manager").owner
    furnace()
    assert operator.invoke(context, None) == {"RUNNING_MODAL"}
    assert window.handlers == [operator] and owner.busy and not bpy.ops.hemibake.bake.poll()
    assert operator.modal(context, MOUSE) == {"PASS_THROUGH"}
    assert drive(operator, context) == {"FINISHED"}
    assert window.is_as_before() and not owner.busy
    texts = window.workspaces[0].texts
    assert any("Bounce 3" in text for text in texts) and any(" s left" in text for text in texts)
    assert "Saving" in texts[-1]
    assert operator.reports[-1][1].startswith("Baked 1 object,")
    assert pixels(bpy.data.images["Lightmap"])[..., :3].max() == pytest.approx(2, rel=0.01)


@pytest.mark.parametrize("wanted", [True, False])
def test_lightmaps_are_shown_when_a_bake_in_a_window_is_done(operator, context, window, wanted):
    import bpy

    bpy.context.scene.hemibake.show_when_done = wanted
    bpy.context.scene.hemibake.resolution = 16
    room, preview = furnace(), part("operators.result.preview")
    own = room.material_slots[0].material
    operator.invoke(context, None)
    drive(operator, context, until=image_shown)
    assert not preview.shows_preview(bpy.context.scene)
    assert drive(operator, context) == {"FINISHED"}
    assert preview.shows_preview(bpy.context.scene) == wanted
    if wanted:
        operator.invoke(context, None)
        assert drive(operator, context) == {"FINISHED"} and preview.shows_preview(bpy.context.scene)
        bpy.ops.hemibake.preview()
    assert room.material_slots[0].material == own


def test_a_bake_that_is_cancelled_shows_nothing(operator, context, window):
    import bpy

    furnace()
    operator.invoke(context, None)
    drive(operator, context, until=image_shown)
    assert operator.modal(context, ESCAPE) == {"CANCELLED"}
    assert not part("operators.result.preview").shows_preview(bpy.context.scene)


def test_nothing_to_bake_is_told_without_a_pop_up(operator, context, window):
    """Blender shows errors in a pop-up that stops all work until the pointer leaves it."""
    import bpy

    settings = bpy.context.scene.hemibake
    settings.method, settings.resolution, settings.target = "auto", 16, "CHANGED"
    furnace()
    operator.invoke(context, None)
    assert drive(operator, context) == {"FINISHED"}
    before, told = snapshot(), len(operator.reports)
    operator.invoke(context, None)
    assert drive(operator, context) == {"CANCELLED"}
    ((kind, text),) = operator.reports[told:]
    assert kind == {"WARNING"} and text.startswith("Nothing has changed")
    assert window.is_as_before() and snapshot() == before


def test_escape_leaves_nothing_behind(operator, context, window):
    furnace()
    before = snapshot()
    operator.invoke(context, None)
    drive(operator, context, until=image_shown)
    assert operator.modal(context, ESCAPE) == {"CANCELLED"}
    assert window.is_as_before()
    assert snapshot() == before


@pytest.mark.parametrize(("age", "goes_on"), [(0, True), (3600, False)])
def test_whoever_cancels_is_told_whether_the_next_bake_goes_on(operator, context, window, age, goes_on):
    folder = part("operators.user_files").cache_folder() / "resume" / "of a scene"
    furnace()
    operator.invoke(context, None)
    drive(operator, context, until=image_shown)

    # On a slow machine the bake itself has written one.
    shutil.rmtree(folder.parent, ignore_errors=True)
    folder.mkdir(parents=True)
    try:
        os.utime(folder, (time.time() - age,) * 2)
        operator.modal(context, ESCAPE)
    finally:
        folder.rmdir()
    assert operator.reports[-1][1].startswith("Bake cancelled")
    assert ("continues from here" in operator.reports[-1][1]) == goes_on


def test_objects_that_are_deleted_in_mid_bake_are_named(operator, context, window):
    import bpy

    furnace()
    gone, renamed = square("Gone", uvs=None), square("Renamed", uvs=None)
    for obj, x in ((gone, 0.2), (renamed, 0.7)):
        obj.location, obj.scale = (x, 0.3, 0.4), (0.2, 0.2, 0.2)
    operator.invoke(context, None)
    drive(operator, context, until=image_shown)
    bpy.data.objects.remove(gone)
    renamed.name = "Other"
    assert drive(operator, context) == {"FINISHED"}
    (note,) = [text for text in report()["warnings"] if "Deleted" in text]
    assert "'Gone'" in note and "Renamed" not in note and renamed.hemibake.image is not None


def test_window_that_draws_slowly_is_redrawn_seldom(operator, context, window, monkeypatch):
    window_bake = part("operators.window_bake")
    monkeypatch.setattr(window_bake, "_PERIODS", (0.2, 2.0))
    clock = SimpleNamespace(now=10.0, perf_counter=lambda: clock.now)
    monkeypatch.setattr(window_bake, "time", clock)
    progress = part("engine.progress").Progress
    bake = window_bake.WindowBake(context, SimpleNamespace(cancel=lambda keep_images: False))
    texts, drawn = window.workspaces[0].texts, []
    try:
        for index in range(200):
            bake.wake()
            before = len(texts)
            bake.show(context, progress("Bounce 3" if index < 100 else "Bounce 4", 0.5, index / 200))
            drawn += [index] if len(texts) > before else []
            clock.now += 0.05 + 0.15 * (len(texts) > before)
        steps = [later - earlier for earlier, later in itertools.pairwise(drawn)]
        assert steps and all(27 <= step <= 33 for step in steps)
        bake.show(context, progress("Saving", 0.0, 0.99))
        assert "Saving" in texts[-1] and "99%" in texts[-1]
    finally:
        bake.leave()


@pytest.mark.parametrize("regions", [None, {"VIEW_3D": ("UI",), "IMAGE_EDITOR": ("WINDOW",)}])
def test_redraw_reaches_the_editors_of_a_real_screen(regions):
    import bpy

    assert any(area.type == "VIEW_3D" for area in bpy.context.window_manager.windows[0].screen.areas)
    part("operators.window_bake").redraw(bpy.context.window_manager, regions)


class Tagged:
    """Area or region of a screen that counts how often it is redrawn."""

    def __init__(self, kind, *regions):
        self.type, self.regions, self.tags = kind, regions, 0

    def tag_redraw(self):
        self.tags += 1


def test_lightmaps_redraw_only_the_regions_that_show_them(context, window):
    window_bake, progress = part("operators.window_bake"), part("engine.progress").Progress
    names = ("HEADER", "TOOLS", "UI", "WINDOW")
    areas = [Tagged(kind, *map(Tagged, names)) for kind in ("VIEW_3D", "OUTLINER", "IMAGE_EDITOR")]
    manager = SimpleNamespace(windows=[SimpleNamespace(screen=SimpleNamespace(areas=areas))])
    bake = window_bake.WindowBake(context, SimpleNamespace(cancel=lambda keep_images: False))
    manager.progress_update = lambda value: None
    counts, bake._manager, before = [], manager, bake._manager
    try:
        for stage, image in (("Visibility", None), ("Bounce 1", np.zeros((1, 2, 2, 3), np.float32))):
            bake.show(context, progress(stage, 0.5, 0.5, intermediate=image))
            counts.append([[region.tags for region in area.regions] for area in areas])
    finally:
        bake._manager = before
        bake.leave()
    assert counts[0] == [[0, 0, 1, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
    assert counts[1] == [[0, 0, 2, 1], [0, 0, 0, 0], [0, 0, 0, 1]]
    assert not any(area.tags for area in areas)


def test_escape_over_another_editor_is_for_that_editor(operator, context, window):
    furnace()
    operator.invoke(context, None)
    drive(operator, context, until=image_shown)
    assert operator.modal(context, ESCAPE_ELSEWHERE) == {"PASS_THROUGH"}
    assert drive(operator, context) == {"FINISHED"}


def test_cancel_button_is_there_while_a_bake_runs_and_leaves_nothing_behind(operator, context, window):
    import bpy

    furnace()
    before = snapshot()
    assert not bpy.ops.hemibake.cancel.poll() and bake_button() == ["hemibake.bake"]
    operator.invoke(context, None)
    drive(operator, context, until=image_shown)
    text, cancel = bake_button()
    assert "%" in text and cancel == "hemibake.cancel"
    assert any("Bounce" in stage for stage in shown_by("draw_stage"))
    bpy.ops.hemibake.cancel()
    assert operator.modal(context, TIMER) == {"CANCELLED"}
    assert window.is_as_before() and snapshot() == before and not bpy.ops.hemibake.cancel.poll()


def bake_button() -> list[str]:
    """Return the texts in place of the bake button."""
    return shown_by("draw_bake_button")


def shown_by(function: str) -> list[str]:
    """Return the texts that a function of panels.bake draws."""
    shown: list[str] = []
    getattr(part("panels.bake"), function)(Layout(shown))
    return shown


def test_dead_worker_is_a_short_error_and_the_image_stays(operator, context, window):
    owner = part("operators.worker_manager").owner
    furnace()
    operator.invoke(context, None)
    drive(operator, context, until=image_shown)
    owner.worker().process.kill()
    assert drive(operator, context) == {"CANCELLED"}
    kind, text = operator.reports[-1]
    assert kind == {"ERROR"} and "Bake again" in text
    assert "\n" not in text and len(text) < 400
    assert window.is_as_before() and image_shown()


def test_last_words_of_a_worker_go_to_the_console(operator, capsys):
    error = part("engine.errors").WorkerError("The process ended. Bake again.\nFatal error\n  line 3")
    part("operators.bake").report_error(operator, error)
    assert operator.reports == [({"ERROR"}, "The process ended. Bake again. (See the system console.)")]
    assert "Fatal error\n  line 3" in capsys.readouterr().err


def test_status_bar_is_blenders_again_whatever_workspace_it_was_in(operator, context, window):
    furnace()
    operator.invoke(context, None)
    drive(operator, context, until=image_shown)
    context.workspace = window.workspaces[1]
    assert drive(operator, context) == {"FINISHED"}
    assert len(window.workspaces[1].texts) > 1
    assert window.is_as_before()


def test_disabling_the_extension_in_mid_bake_leaves_nothing_behind(operator, context, window):
    import bpy

    furnace()
    before = snapshot()
    operator.invoke(context, None)
    drive(operator, context, until=image_shown)
    process = part("operators.worker_manager").owner.worker().process
    disable()
    try:
        assert window.is_as_before() and process.poll() is not None
    finally:
        enable()
    assert snapshot() == before
    assert bpy.ops.hemibake.bake.poll()


@pytest.mark.parametrize("copied", [False, long(True)])
def test_object_whose_uvs_were_undone_in_mid_bake_is_named_and_not_written(operator, context, window, copied):
    import bpy

    room = furnace()
    if copied:
        room.modifiers.new("Array", "ARRAY").relative_offset_displace = (3, 0, 0)
    square("Kept", [(0.4, 0.4), (0.6, 0.4), (0.6, 0.6), (0.4, 0.6)]).location = (0.2, 0.2, 0.5)
    bpy.data.objects["Kept"].hemibake.atlas = "Own"
    bpy.ops.ed.undo_push(message="Both objects are there")
    bpy.data.objects["Kept"].scale = (0.5, 0.5, 0.5)
    bpy.ops.ed.undo_push(message="One is smaller")
    operator.invoke(context, None)
    drive(operator, context, until=image_shown)
    bpy.ops.ed.undo()
    assert drive(operator, context) == {"FINISHED"}
    lost, kept = bpy.data.objects["Furnace"], bpy.data.objects["Kept"]
    (warning,) = [text for kind, text in operator.reports if kind == {"WARNING"} and "lost" in text]
    assert "'Furnace'" in warning and "Bake again" in warning and "Kept" not in warning
    assert "Lightmap" not in lost.data.uv_layers and lost.hemibake.image is None
    assert [modifier.name for modifier in lost.modifiers] == ["Array"] * copied
    assert kept.hemibake.image.name == "Own" and report()["objects"] == 1


def test_bake_of_objects_whose_uvs_were_all_undone_ends(operator, context, window):
    """UVs are made for a step of their own, the newest one: that is what somebody takes back."""
    import bpy

    room = furnace()
    for step in range(3):
        room.location.x = step
        bpy.ops.ed.undo_push(message=f"Moved to {step}")
    before = snapshot()
    handlers = [list(getattr(bpy.app.handlers, f"{step}_post")) for step in ("undo", "redo")]
    operator.invoke(context, None)
    drive(operator, context, until=image_shown)
    assert "Lightmap" in bpy.data.objects["Furnace"].data.uv_layers
    bpy.ops.ed.undo()
    assert drive(operator, context) == {"CANCELLED"} and window.is_as_before()
    assert operator.reports[-1] == (
        {"INFO"}, "Bake cancelled, because undo removed the lightmap UVs of all objects"
    )  # fmt: skip
    assert snapshot() == before and not part("operators.worker_manager").owner.busy
    assert handlers == [bpy.app.handlers.undo_post[:], bpy.app.handlers.redo_post[:]]


def test_an_undo_that_takes_nothing_of_what_is_baked_ends_nothing(operator, context, window):
    """Here only instances are baked."""
    import bpy

    bpy.context.scene.hemibake.resolution = 67
    chair, chairs = furnace("Chair"), bpy.data.collections.new("Chairs")
    bpy.context.scene.collection.objects.unlink(chair)
    chairs.objects.link(chair)
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", chairs
    bpy.context.scene.collection.objects.link(instance)
    bpy.context.view_layer.update()
    operator.invoke(context, None)
    drive(operator, context, until=lambda: "Lightmap instances" in bpy.data.images)
    for handler in bpy.app.handlers.undo_post[:]:
        handler(bpy.context.scene)
    assert drive(operator, context) == {"FINISHED"}
    assert report()["objects"] == 0 and instance.hemibake.instances


def bake_with_history(operator, context):
    """Move a furnace in three steps that can be undone, then bake until its image is shown."""
    import bpy

    obj = furnace()
    for step in range(3):
        obj.location.x = step
        bpy.ops.ed.undo_push(message=f"Moved to {step}")
    operator.invoke(context, None)
    drive(operator, context, until=image_shown)


def test_undo_in_mid_bake_leaves_no_pointer_to_an_image_that_it_frees(operator, context):
    """It takes the UVs of one object away, not those of the other."""
    import bpy

    square("Beside", [(0.8, 0.8), (0.9, 0.8), (0.9, 0.9), (0.8, 0.9)]).location = (5, 5, 5)
    bake_with_history(operator, context)
    bpy.ops.ed.undo()
    assert not image_shown() and len(bpy.context.scene.hemibake.lightmaps) == 0
    assert drive(operator, context) == {"FINISHED"}
    assert bpy.context.scene.hemibake.lightmaps["Lightmap"].image == bpy.data.images["Lightmap"]


def test_image_that_stays_after_a_failure_is_known_to_undo_and_to_the_next_bake(operator, context):
    import bpy

    bake_with_history(operator, context)
    part("operators.worker_manager").owner.worker().process.kill()
    assert drive(operator, context) == {"CANCELLED"}
    bpy.ops.ed.undo()
    assert not image_shown() and len(bpy.context.scene.hemibake.lightmaps) == 0
    assert bpy.data.objects["Furnace"].location.x == 2
    bpy.ops.ed.redo()
    bpy.ops.hemibake.bake()
    assert [image.name for image in bpy.data.images if image.get("hemibake_atlas")] == ["Lightmap"]


def test_undo_in_mid_bake_takes_the_uv_modifier_back_with_all_it_refers_to(operator, context):
    import bpy

    room, other = furnace(), square("Other")
    room.modifiers.new("Array", "ARRAY").constant_offset_displace = (2, 0, 0)
    for step in range(3):
        other.location.z = step
        bpy.ops.ed.undo_push(message=f"Moved to {step}")
    operator.invoke(context, None)
    drive(operator, context, until=image_shown)
    assert len(room.modifiers) == 2
    bpy.ops.ed.undo()
    room = bpy.data.objects["Furnace"]
    assert [modifier.name for modifier in room.modifiers] == ["Array"]
    assert len(bpy.data.node_groups) == 0 and bpy.data.objects["Other"].location.z == 2
    assert drive(operator, context) == {"FINISHED"}
    assert any("'Furnace'" in text and "Bake again" in text for _, text in operator.reports)
    assert room.hemibake.image is None


def test_script_in_a_window_has_the_worker_bake_and_waits(monkeypatch):
    import bpy

    owner_module = part("operators.worker_manager")
    in_process = []
    monkeypatch.setattr(owner_module, "bpy", SimpleNamespace(app=SimpleNamespace(background=False)))
    monkeypatch.setattr(part("engine.device.gl_context"), "_create_context", lambda: in_process.append(True))
    furnace()
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    assert owner_module.owner.worker().alive and not in_process
    assert pixels(bpy.data.images["Lightmap"])[..., :3].max() == pytest.approx(2, rel=0.01)


def test_scene_that_cannot_be_baked_gives_the_window_back(operator, context, window):
    operator.invoke(context, None)
    assert drive(operator, context) == {"CANCELLED"}
    assert operator.reports[0][0] == {"ERROR"} and window.is_as_before()
    assert not part("operators.worker_manager").owner.busy


def test_unwrap_runs_to_its_end_between_events(unwrap_operator, context, window):
    obj = furnace()
    assert unwrap_operator.invoke(context, None) == {"RUNNING_MODAL"}
    assert part("operators.worker_manager").owner.busy
    assert drive(unwrap_operator, context) == {"FINISHED"}
    assert window.is_as_before() and "Lightmap" in obj.data.uv_layers
    assert any("Unwrapping" in text for text in window.workspaces[0].texts)
    assert unwrap_operator.reports[-1][1].startswith("1 object unwrapped")


@pytest.mark.parametrize("events", [1, 3, 20])
def test_escape_while_unwrapping_leaves_nothing_behind(unwrap_operator, context, window, events):
    for number in range(7):
        furnace(f"Room {number}").modifiers.new("Array", "ARRAY")
    before = snapshot()
    unwrap_operator.invoke(context, None)
    for _ in range(events):
        assert unwrap_operator.modal(context, TIMER) == {"PASS_THROUGH"}
    assert unwrap_operator.modal(context, ESCAPE) == {"CANCELLED"}
    assert window.is_as_before() and snapshot() == before
    assert not part("operators.worker_manager").owner.busy


@pytest.mark.parametrize("name", ["repack", "unwrap"])
@pytest.mark.parametrize("events", [2, long(0), long(8)])
def test_packing_again_is_modal_and_escape_leaves_everything(name, events, context, window):
    import bpy

    for number in range(5):
        furnace(f"Room {number}")
    copied = furnace("Copied")
    copied.modifiers.new("Array", "ARRAY")
    bpy.ops.hemibake.unwrap()
    bpy.ops.hemibake.lightmap_add()
    settings = bpy.context.scene.hemibake
    settings.active_lightmap = settings.lightmaps.find("Lightmap")
    settings.resolution = 61
    lightmaps, before = part("operators.lightmaps"), snapshot()
    operator = stand_in_for(getattr(lightmaps, f"HEMIBAKE_OT_lightmap_{name}"))
    assert operator.invoke(context, None) == {"RUNNING_MODAL"}
    for _ in range(events):
        assert operator.modal(context, TIMER) == {"PASS_THROUGH"}
    assert operator.modal(context, ESCAPE) == {"CANCELLED"}
    assert window.is_as_before() and snapshot() == before
    assert operator.invoke(context, None) == {"RUNNING_MODAL"}
    assert drive(operator, context) == {"FINISHED"}
    assert window.is_as_before() and snapshot() != before
    assert "packed into 'Lightmap'" in operator.reports[-1][1]


def test_object_that_is_deleted_or_edited_while_it_is_unwrapped(unwrap_operator, context, window):
    import bpy

    gone, edited, kept = furnace("Gone"), furnace("Edited"), furnace("Kept")
    unwrap_operator.invoke(context, None)
    for _ in range(3):
        unwrap_operator.modal(context, TIMER)
    bpy.data.objects.remove(gone)
    edited.data.clear_geometry()
    edited.data.from_pydata([(4, 0, 0), (5, 0, 0), (4, 1, 0)], [], [(0, 1, 2)])
    assert drive(unwrap_operator, context) == {"FINISHED"}
    assert "Lightmap" in kept.data.uv_layers and "Lightmap" in edited.data.uv_layers


def test_object_that_can_have_no_uvs_is_deleted_while_others_are_packed(
    unwrap_operator, context, monkeypatch
):
    import bpy

    unwrap_process, made = part("operators.scene.uvs.unwrap_process"), []
    new_worker = unwrap_process.new_worker
    monkeypatch.setattr(unwrap_process, "new_worker", lambda *job: made.append(new_worker(*job)) or made[-1])
    left, kept = furnace("Left"), furnace("Kept")
    left.data.attributes.new("Lightmap", "FLOAT", "POINT")
    unwrap_operator.invoke(context, None)
    drive(unwrap_operator, context, until=lambda: bool(made and made[0].process))
    bpy.data.objects.remove(left)
    assert drive(unwrap_operator, context) == {"FINISHED"}
    assert "Lightmap" in kept.data.uv_layers


def test_process_that_unwraps_dies_and_is_replaced(unwrap_operator, context, monkeypatch):
    """The first of two is killed; the object has its UVs nevertheless."""
    unwrap_process, made = part("operators.scene.uvs.unwrap_process"), []
    new_worker = unwrap_process.new_worker
    monkeypatch.setattr(unwrap_process, "new_worker", lambda *job: made.append(new_worker(*job)) or made[-1])
    obj = furnace()
    unwrap_operator.invoke(context, None)
    drive(unwrap_operator, context, until=lambda: bool(made and made[0].process))
    made[0].process.kill()
    assert drive(unwrap_operator, context) == {"FINISHED"}
    assert len(made) == 2 and "Lightmap" in obj.data.uv_layers
