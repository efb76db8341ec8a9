"""Live, driven by events in a stand-in for a window; see test_modal.py. The worker process is real."""

import json
import time

import numpy as np
import pytest

from tests.blender.test_light_probes import probe_volume
from tests.blender.test_modal import (  # noqa: F401
    ESCAPE,
    TIMER,
    Window,
    bake_button,
    context,
    drive,
    image_shown,
    stand_in_for,
    window,
)
from tests.blender.things import CUBE, INWARD, furnace, material, mesh_object, part, pixels, snapshot


@pytest.fixture(autouse=True)
def quick(empty_scene):
    """Set up a scene that bakes within a moment."""
    import bpy

    bpy.context.scene.hemibake.resolution = 24


@pytest.fixture
def operator(monkeypatch):
    live = stand_in_for(part("operators.live").HEMIBAKE_OT_live)
    live.bl_label = "Live"
    monkeypatch.setattr(part("operators.live"), "push_undo", lambda message: undo_steps.append(message))
    undo_steps.clear()
    yield live
    running = part("operators.worker_manager").owner.running
    if running is not None:
        running.cancel()


undo_steps: list[str] = []


@pytest.fixture(autouse=True)
def no_view(monkeypatch, quick):
    """There is no 3D view to switch."""
    for name in ("show_materials", "restart_renders"):
        monkeypatch.setattr(part("operators.live"), name, lambda *_: None)


def lit_room():
    """Return a closed grey cube with a lamp in it, and the lamp."""
    import bpy

    room = mesh_object("Room", CUBE, INWARD, surface=material())
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    lamp.data.energy, lamp.location = 10, (0.5, 0.5, 0.5)
    bpy.context.scene.collection.objects.link(lamp)
    bpy.context.view_layer.update()
    return room, lamp


def start(operator, context) -> None:  # noqa: F811
    """Start Live, and wait until the first bake has come to its end."""
    assert operator.invoke(context, None) == {"RUNNING_MODAL"}
    running = part("operators.worker_manager").owner.running
    assert drive(operator, context, until=lambda: running.following) == {"PASS_THROUGH"}


def settle(operator, context) -> np.ndarray:  # noqa: F811
    """Wait until the lightmap shows the changes, and return it."""
    import bpy

    bpy.context.view_layer.update()
    run = part("operators.worker_manager").owner.running.run
    for _ in range(3):
        operator.modal(context, TIMER)
    drive(operator, context, until=lambda: run.converged)
    return pixels(bpy.data.images["Lightmap"])[..., :3]


def baked_anew(scene) -> np.ndarray:
    """Return the lightmap of a bake of its own."""
    import bpy

    bpy.ops.hemibake.bake()
    return pixels(scene.hemibake.lightmaps["Lightmap"].image)[..., :3].copy()


def test_another_frame_has_its_own_light(operator, context, window):  # noqa: F811
    """A lamp whose power is animated, and then an object that moves into its light."""
    import bpy

    _, lamp = lit_room()
    lamp.data.keyframe_insert("energy", frame=1)
    lamp.data.energy = 40
    lamp.data.keyframe_insert("energy", frame=11)
    box = mesh_object("Box", np.array(CUBE) * 0.3 + 2.0, [face[::-1] for face in INWARD])
    box.hemibake.role = "NO_LIGHTMAP"
    box.keyframe_insert("location", frame=11)
    box.location = (-1.95, -1.95, -1.95)
    box.keyframe_insert("location", frame=21)
    bpy.context.scene.frame_set(1)
    start(operator, context)
    first = settle(operator, context).copy()
    bpy.context.scene.frame_set(11)
    lit = settle(operator, context).copy()
    assert lit == pytest.approx(4 * first, rel=0.02)
    bpy.context.scene.frame_set(21)
    assert np.abs(settle(operator, context) - lit).max() > 0.3 * lit.max()
    operator.invoke(context, None)
    assert drive(operator, context) == {"FINISHED"} and window.is_as_before()


def test_edits_show_and_the_light_is_that_of_a_bake(operator, context, window):  # noqa: F811
    import bpy

    room, lamp = lit_room()
    start(operator, context)
    assert operator.reports[-1][1].startswith("Baked 1 object") and undo_steps[-1] == "Live"
    assert room.material_slots[0].material.name.endswith("(lightmap)")
    first = settle(operator, context)

    # Light, colour, emission, world, and an object that is new.
    lamp.data.energy = 40
    assert settle(operator, context) == pytest.approx(4 * first, rel=0.02)
    lamp.location = (0.2, 0.7, 0.8)
    grey = bpy.data.materials["Grey"]
    grey.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.8, 0.1, 0.3, 1)
    grey.node_tree.nodes["Principled BSDF"].inputs["Emission Strength"].default_value = 0.2
    settle(operator, context)
    pillar = mesh_object(
        "Pillar", np.array(CUBE) * [0.2, 0.2, 0.5] + [0.3, 0.3, 0.2], [f[::-1] for f in INWARD]
    )
    settle(operator, context)
    pillar.location.x = 0.15
    last = settle(operator, context).copy()

    assert bpy.ops.hemibake.bake.poll() is False
    operator.invoke(context, None)
    assert drive(operator, context) == {"FINISHED"} and window.is_as_before()
    assert np.array_equal(pixels(bpy.data.images["Lightmap"])[..., :3], last)
    pillar.hemibake.role = "NO_LIGHTMAP"
    again = baked_anew(bpy.context.scene)
    known = again.sum(axis=2) > 0.01 * again.sum(axis=2).max()
    assert np.abs(last - again)[known].mean() < 0.01 * again[known].mean()


def test_escape_before_the_first_bake_is_done_leaves_nothing_behind(operator, context, window):  # noqa: F811
    furnace()
    settings = context.scene.hemibake
    settings.tolerance, settings.max_bounces = 0, 500  # so that the bake goes on after its first image
    before = snapshot()
    operator.invoke(context, None)
    drive(operator, context, until=image_shown)
    assert operator.modal(context, ESCAPE) == {"CANCELLED"}
    assert window.is_as_before() and snapshot() == before and "Live" not in undo_steps


def test_escape_later_is_for_whatever_else_happens_and_cancel_ends_live(operator, context, window):  # noqa: F811
    import bpy

    lit_room()
    start(operator, context)
    assert operator.modal(context, ESCAPE) == {"PASS_THROUGH"}
    assert "The Live button ends it" in window.workspaces[0].texts[-1]
    assert bake_button()[-1] == "hemibake.cancel"
    bpy.ops.hemibake.cancel()
    assert drive(operator, context) == {"FINISHED"} and window.is_as_before()
    assert not part("operators.worker_manager").owner.busy


def test_nothing_happens_while_nothing_changes(operator, context, window, monkeypatch):  # noqa: F811
    """Changed pixels of lightmaps, and changes without effect on light, start no bake."""
    import bpy

    room, _ = lit_room()
    start(operator, context)
    settle(operator, context)
    sent = []
    owner = part("operators.worker_manager").owner
    monkeypatch.setattr(owner.worker(), "update", sent.append)
    room.select_set(True)
    bpy.context.scene.cursor.location.x = 3
    settle(operator, context)
    run = owner.running.run
    run._images.show(pixels(bpy.data.images["Lightmap"])[None, ..., :3])
    bpy.context.view_layer.update()
    assert sent == [] and not run._watch.changed


def test_only_what_has_changed_is_sent(operator, context, window, monkeypatch):  # noqa: F811
    _, lamp = lit_room()
    start(operator, context)
    settle(operator, context)
    sent = []
    monkeypatch.setattr(part("operators.worker_manager").owner.worker(), "update", sent.append)
    lamp.data.energy = 20
    for _ in range(6):
        import bpy

        bpy.context.view_layer.update()
        operator.modal(context, TIMER)
    (changes,) = sent
    assert len(changes.lights) == 1 and changes.world is None
    assert not changes.materials and not changes.meshes


def test_a_dead_worker_ends_live_and_stores_the_lightmap(operator, context, window):  # noqa: F811
    import bpy

    _, lamp = lit_room()
    start(operator, context)
    lamp.data.energy = 40
    shown = settle(operator, context).copy()
    part("operators.worker_manager").owner.worker().process.kill()
    assert drive(operator, context) == {"CANCELLED"} and window.is_as_before()
    assert operator.reports[-1][0] == {"ERROR"} and "process" in operator.reports[-1][1]
    image = bpy.data.images["Lightmap"]
    image.reload()
    assert np.array_equal(pixels(image)[..., :3], shown)

    # The next one starts a new worker.
    start(operator, context)


def test_a_bake_of_changed_objects_begins_with_what_live_has_left(operator, context, window):  # noqa: F811
    import bpy

    _, lamp = lit_room()
    start(operator, context)
    lamp.data.energy = 40
    settle(operator, context)
    operator.invoke(context, None)
    assert drive(operator, context) == {"FINISHED"}
    bpy.context.scene.hemibake.target = "CHANGED"
    with pytest.raises(RuntimeError, match="Nothing has changed"):
        bpy.ops.hemibake.bake()


def test_what_changes_while_live_ends_counts_as_changed(operator, context, window):  # noqa: F811
    """The window closes after the scene was read, and before there is a lightmap of it."""
    import bpy

    room, _ = lit_room()
    start(operator, context)
    settle(operator, context)
    running = part("operators.worker_manager").owner.running
    before = running.run._read
    room.location.x = 0.5
    bpy.context.view_layer.update()
    while running.run._read is before:
        running.run.step()
    operator.cancel(context)
    bpy.context.scene.hemibake.target = "CHANGED"
    assert bpy.ops.hemibake.bake() == {"FINISHED"}


def test_undo_in_between_is_followed(operator, context, window):  # noqa: F811
    """The lamp's datablock is another one after an undo; its handlers tell of it."""
    import bpy

    _, lamp = lit_room()
    start(operator, context)
    before = settle(operator, context).copy()
    lamp.data.energy = 40
    brighter = settle(operator, context).copy()
    lamp.data.energy = 10
    for handler in list(bpy.app.handlers.undo_post):
        handler(bpy.context.scene)
    assert settle(operator, context) == pytest.approx(before, rel=0.01, abs=1e-4)
    assert brighter.sum() > 3 * before.sum()


def test_an_undo_of_its_beginning_ends_it(operator, context, window):  # noqa: F811
    """The undo restores the materials of objects; the earlier lightmaps stay."""
    import bpy

    lit_room()
    bpy.ops.ed.undo_push(message="A room")
    start(operator, context)
    settle(operator, context)
    bpy.ops.ed.undo_push(message="Live")
    bpy.ops.ed.undo()
    assert drive(operator, context) == {"CANCELLED"} and window.is_as_before()
    assert "was undone" in operator.reports[-1][1]
    assert bpy.data.objects["Room"].material_slots[0].material.name == "Grey"
    assert not part("operators.worker_manager").owner.busy


@pytest.mark.usefixtures("window")
def test_an_undo_in_edit_mode_goes_on(operator, context):  # noqa: F811
    """Its steps hold a mesh alone: preview materials that were set aside for it are made again."""
    import bpy

    room, _ = lit_room()
    bpy.context.view_layer.objects.active = room
    bpy.ops.ed.undo_push(message="A room")
    start(operator, context)
    settle(operator, context)
    bpy.ops.ed.undo_push(message="Live")
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.ed.undo_push(message="Edit Mode")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.ed.undo_push(message="Select")
    told = len(operator.reports)
    bpy.ops.ed.undo()
    settle(operator, context)
    room = bpy.data.objects["Room"]
    assert room.mode == "EDIT" and len(operator.reports) == told
    assert part("operators.worker_manager").owner.running is not None
    assert room.material_slots[0].material.name == "Grey (lightmap)"
    bpy.ops.object.mode_set(mode="OBJECT")


def test_light_shows_however_fast_changes_follow_each_other(operator, context, window):  # noqa: F811
    """Something moves in each event, as while the timeline plays: readings do not keep images away."""
    import bpy

    room, _ = lit_room()
    start(operator, context)
    settle(operator, context)
    run, shown = part("operators.worker_manager").owner.running.run, []
    show, sent = run._images.show, part("operators.worker_manager").owner.worker().update
    run._images.show = lambda images: shown.append(1) or show(images)
    updates = []
    part("operators.worker_manager").owner.worker().update = lambda changes: (
        updates.append(1) or sent(changes)
    )
    for step in range(300):
        room.location.x = 0.001 * (step % 7)
        bpy.context.view_layer.update()
        operator.modal(context, TIMER)
        if len(shown) >= 3:
            break
    assert len(shown) >= 3 and len(updates) <= len(shown) + 1
    del part("operators.worker_manager").owner.worker().update
    settle(operator, context)


def test_large_scenes_are_not_read_while_the_timeline_plays(operator, context, window, monkeypatch):  # noqa: F811
    """Lamps are read; other changes follow when the timeline stops."""
    import bpy

    room, lamp = lit_room()
    start(operator, context)
    first = settle(operator, context).copy()
    module, plays = part("operators.live_run"), [True]
    monkeypatch.setattr(module, "_FEW", 10)
    monkeypatch.setattr(module, "_timeline_plays", lambda: plays[0])
    read, kept = [], module.read_scene
    monkeypatch.setattr(
        module, "read_scene", lambda *args, **options: read.append(1) or kept(*args, **options)
    )
    room.scale = (2, 2, 2)
    lamp.data.energy = 40
    bpy.context.view_layer.update()
    for _ in range(40):
        operator.modal(context, TIMER)
        time.sleep(0.02)
    lit = pixels(bpy.data.images["Lightmap"])[..., :3].copy()
    assert lit == pytest.approx(4 * first, rel=0.02) and not read
    plays[0] = False
    assert settle(operator, context).mean() < 0.5 * lit.mean() and read


def test_readings_of_large_scenes_are_given_up_for_playback(operator, context, window, monkeypatch):  # noqa: F811
    """Reading would start again in each frame. The button ends Live without reading again."""
    import bpy

    room, lamp = lit_room()
    start(operator, context)
    settle(operator, context)
    module, plays, hurries = part("operators.live_run"), [False], []

    def read(*arguments, **options):
        hurries.append(arguments[-1])
        plays[0] = True
        yield None
        raise module.SceneChangedError

    monkeypatch.setattr(module, "_FEW", 10)
    monkeypatch.setattr(module, "_timeline_plays", lambda: plays[0])
    monkeypatch.setattr(module, "read_scene", read)
    room.location.x = 0.1
    bpy.context.view_layer.update()
    for _ in range(20):
        operator.modal(context, TIMER)
    assert hurries == [False]
    lamp.data.energy = 40
    bpy.context.view_layer.update()
    for _ in range(20):
        operator.modal(context, TIMER)
        time.sleep(0.02)
    operator.invoke(context, None)
    assert drive(operator, context) == {"FINISHED"} and hurries == [False] and window.is_as_before()


def test_disabling_the_extension_ends_live_and_stores_the_lightmap(operator, context, window):  # noqa: F811
    import bpy

    lit_room()
    start(operator, context)
    settle(operator, context)
    shown = part("operators.preview_switch")._shown
    shown.active = bpy.context.scene.session_uid
    part("operators.worker_manager").owner.stop()
    assert shown.active is None
    assert window.is_as_before() and not part("operators.worker_manager").owner.busy
    assert bpy.data.images["Lightmap"].packed_file is not None
    handlers = [*bpy.app.handlers.depsgraph_update_post, *bpy.app.handlers.undo_post]
    assert not any("live_watch" in handler.__module__ for handler in handlers)


@pytest.mark.parametrize("what", ["lightmap", "light group"])
def test_lightmaps_or_groups_that_are_added_start_it_anew(operator, context, window, what):  # noqa: F811
    import bpy

    room, lamp = lit_room()
    bpy.context.scene.hemibake.outputs = {"combined", "light_groups"}
    start(operator, context)
    settle(operator, context)
    owner = part("operators.worker_manager").owner
    before = owner.running
    if what == "lightmap":
        room.hemibake.atlas, room.location.x = "Another", 0.01
    else:
        bpy.context.view_layer.lightgroups.add(name="Night")
        lamp.lightgroup, lamp.data.energy = "Night", 11
    bpy.context.view_layer.update()
    drive(operator, context, until=lambda: owner.running is not before and owner.running.following)
    names = {"Another" if what == "lightmap" else "Lightmap light group Night"}
    assert names <= {entry.name for entry in bpy.context.scene.hemibake.lightmaps}
    operator.invoke(context, None)
    assert drive(operator, context) == {"FINISHED"} and window.is_as_before()
    shown = room.material_slots[0].material.node_tree.nodes
    mixed = [node.image.name for node in shown if node.type == "TEX_IMAGE"]
    lightmap = room.hemibake.image.name
    assert mixed == [f"{lightmap} light group {'Ungrouped' if what == 'lightmap' else 'Night'}"]


def test_light_probes_follow_lamps_and_volumes(operator, context, window):  # noqa: F811
    """Four times the power shows in the same image; only a volume that moves starts Live again."""
    import bpy

    scene = bpy.context.scene
    _, lamp = lit_room()
    volume = probe_volume(resolution=(2, 1, 1))
    scene.hemibake.light_probes, scene.hemibake.samples = True, 32
    start(operator, context)
    settle(operator, context)
    (entry,) = scene.hemibake.probe_volumes
    image, first = entry.image, pixels(entry.image).copy()
    assert first[..., 0].max() > 0
    lamp.data.energy *= 4
    settle(operator, context)
    assert scene.hemibake.probe_volumes[0].image == image
    assert pixels(image)[..., :3] == pytest.approx(
        4 * first[..., :3], rel=0.02, abs=1e-3 * float(first.max())
    )
    owner = part("operators.worker_manager").owner
    before = owner.running
    box = mesh_object("Box", np.array(CUBE) * 0.1 + [0.8, 0.8, 5.0], [face[::-1] for face in INWARD])
    settle(operator, context)
    box.location.x = -2
    settle(operator, context)
    assert owner.running is before
    volume.location.x -= 0.05
    bpy.context.view_layer.update()
    drive(operator, context, until=lambda: owner.running is not before and owner.running.following)
    assert scene.hemibake.probe_volumes[0].matrix[3] == pytest.approx(0.45)
    operator.invoke(context, None)
    assert drive(operator, context) == {"FINISHED"} and window.is_as_before()


def shown_colours(obj) -> list[tuple[float, ...]]:
    """Return the colors by which an object's preview material multiplies its lightmap, or which it emits."""
    nodes = obj.material_slots[0].material.node_tree.nodes
    return [
        tuple(round(value, 4) for value in node.inputs[0].default_value[:3])
        for node in nodes
        if node.inputs
        and not node.inputs[0].is_linked
        and (node.label.startswith("Reflectance") or node.type == "EMISSION")
    ]


def test_a_material_that_is_edited_shows_in_the_preview_and_undo_does_not_harm(operator, context, window):  # noqa: F811
    import bpy

    room, lamp = lit_room()
    start(operator, context)
    settle(operator, context)
    bpy.ops.ed.undo_push(message="Before")
    shader = bpy.data.materials["Grey"].node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (0.8, 0.1, 0.3, 1)
    shader.inputs["Emission Color"].default_value = (0.25, 0.5, 1, 1)
    shader.inputs["Emission Strength"].default_value = 0.2
    bpy.ops.ed.undo_push(message="Recoloured")
    settle(operator, context)
    assert shown_colours(room) == [(0.8, 0.1, 0.3), (0.25, 0.5, 1)]
    lamp.location.x = 0.4
    bpy.ops.ed.undo_push(message="Moved")
    settle(operator, context)

    # Preview materials that were made since the last step are not there while it is undone.
    for _ in range(2):
        bpy.ops.ed.undo()
    settle(operator, context)
    room = bpy.data.objects["Room"]
    assert shown_colours(room) == [(0.5, 0.5, 0.5)]
    for _ in range(2):
        bpy.ops.ed.redo()
    settle(operator, context)
    assert shown_colours(bpy.data.objects["Room"]) == [(0.8, 0.1, 0.3), (0.25, 0.5, 1)]
    assert sum(PREVIEW_END in material.name for material in bpy.data.materials) == 1


PREVIEW_END = "(lightmap)"


def test_a_slot_that_is_filled_meanwhile_shows_its_light_and_is_kept(operator, context, window):  # noqa: F811
    import bpy

    room, _ = lit_room()
    start(operator, context)
    before = settle(operator, context).copy()
    room.material_slots[0].material = material("Black", (0, 0, 0))
    assert settle(operator, context).sum() < 0.7 * before.sum()
    assert shown_colours(room) == [(0, 0, 0)]
    bpy.ops.hemibake.preview()
    assert room.material_slots[0].material.name == "Black"


def test_a_file_that_is_saved_has_the_light_that_is_shown(operator, context, window, tmp_path):  # noqa: F811
    """Meanwhile the pixels are packed: of images in files Cycles shows the files."""
    import bpy

    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "room.blend"))
    _, lamp = lit_room()
    start(operator, context)
    image = bpy.data.images["Lightmap"]
    assert image.source == "FILE" and image.packed_file is not None
    lamp.data.energy = 40
    shown = settle(operator, context).copy()
    bpy.ops.wm.save_mainfile()
    assert image.packed_file is not None and np.array_equal(pixels(image)[..., :3], shown)
    stored = bpy.data.images.load(bpy.path.abspath(image.filepath))
    stored.colorspace_settings.name = image.colorspace_settings.name
    assert np.array_equal(pixels(stored)[..., :3], shown)

    bpy.ops.hemibake.cancel()
    assert drive(operator, context) == {"FINISHED"} and image.packed_file is None


def test_probes_that_are_saved_have_the_place_of_their_bake(operator, context, window, tmp_path):  # noqa: F811
    """Saving before the light of a new object is baked; the object has moved the origin of the scene."""
    import bpy

    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "room.blend"))
    lit_room()
    probe_volume(resolution=(2, 1, 1))
    bpy.context.scene.hemibake.light_probes, bpy.context.scene.hemibake.samples = True, 32
    start(operator, context)
    settle(operator, context)
    run = part("operators.worker_manager").owner.running.run
    mesh_object("Far", np.array(CUBE) + 50.0, [face[::-1] for face in INWARD])
    bpy.context.view_layer.update()
    drive(operator, context, until=lambda: run._read is not run._of_lightmap)
    last_read = run._read
    assert np.linalg.norm(last_read.scene.origin - run._of_lightmap.scene.origin) > 1
    bpy.ops.wm.save_mainfile()
    made = json.loads((tmp_path / "lightmaps" / "hemibake.json").read_text())
    assert [row[3] for row in made["probes"][0]["matrix"]] == pytest.approx([0.5, 0.5, 0.5, 1])
    assert run._read is last_read and not run.converged
    bpy.ops.hemibake.cancel()
    assert drive(operator, context) == {"FINISHED"}


def test_a_mesh_in_edit_mode_is_followed_and_settles(operator, context, window):  # noqa: F811
    """Reading stores the edited mesh, which Blender reports as a change."""
    import bmesh
    import bpy

    lit_room()
    pillar = mesh_object(
        "Pillar", np.array(CUBE) * [0.2, 0.2, 0.5] + [0.3, 0.3, 0.2], [f[::-1] for f in INWARD]
    )
    start(operator, context)
    before = settle(operator, context).copy()
    bpy.context.view_layer.objects.active = pillar
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        for vertex in bmesh.from_edit_mesh(pillar.data).verts:
            vertex.co.z += 0.3
        bmesh.update_edit_mesh(pillar.data)
        moved = settle(operator, context).copy()
        run = part("operators.worker_manager").owner.running.run
        for _ in range(5):
            operator.modal(context, TIMER)
        assert run.converged and bpy.context.mode == "EDIT_MESH"
        assert np.abs(moved - before).sum() > 0.01 * before.sum()
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")


def test_a_file_saved_under_another_name_has_its_own_lightmaps(operator, context, window, tmp_path):  # noqa: F811
    import bpy

    _, lamp = lit_room()
    start(operator, context)
    settle(operator, context)
    for name in ("first", "other/second"):
        path = tmp_path / f"{name}.blend"
        path.parent.mkdir(exist_ok=True)
        lamp.data.energy *= 2
        shown = settle(operator, context).copy()
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
        image = bpy.data.images["Lightmap"]
        file = path.parent / "lightmaps" / f"{path.stem}_Lightmap.exr"
        assert bpy.path.abspath(image.filepath) == str(file)
        stored = bpy.data.images.load(str(file))
        stored.colorspace_settings.name = image.colorspace_settings.name
        assert np.array_equal(pixels(stored)[..., :3], shown)

    # A copy has its own, too, but what follows belongs to the file before.
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "copy.blend"), copy=True)
    assert (tmp_path / "lightmaps" / "copy_Lightmap.exr").exists()
    assert bpy.path.abspath(image.filepath) == str(file) == bpy.path.abspath(image.packed_files[0].filepath)
    assert np.array_equal(pixels(image)[..., :3], shown)
    lamp.data.energy *= 2
    settle(operator, context)
    bpy.ops.hemibake.cancel()
    assert drive(operator, context) == {"FINISHED"}
    assert bpy.path.abspath(image.filepath) == str(file)


def test_only_the_button_cancels_a_start_by_other_settings(operator, context, window):  # noqa: F811
    import bpy

    lit_room()
    start(operator, context)
    before = settle(operator, context).copy()
    owner = part("operators.worker_manager").owner
    first = owner.running
    bpy.context.scene.hemibake.resolution = 48
    drive(operator, context, until=lambda: owner.running is not first)
    assert not owner.running.following and owner.running.how_to_end == "The Live button ends it"
    assert operator.modal(context, ESCAPE) == {"PASS_THROUGH"} and owner.running is not None
    assert operator.invoke(context, None) == {"CANCELLED"}
    assert operator.modal(context, TIMER) == {"CANCELLED"}
    assert owner.running is None and window.is_as_before()
    image = bpy.data.images["Lightmap"]
    assert image.size[:] == (24, 24) and np.array_equal(pixels(image)[..., :3], before)


def test_other_settings_start_it_anew(operator, context, window):  # noqa: F811
    import bpy

    _, lamp = lit_room()
    start(operator, context)
    settle(operator, context)
    before = part("operators.worker_manager").owner.running
    bpy.context.scene.hemibake.resolution = 40
    bpy.context.view_layer.update()
    owner = part("operators.worker_manager").owner
    drive(operator, context, until=lambda: owner.running is not before and owner.running.following)
    assert len(window.timers) == 1 and undo_steps == ["Make Lightmap UVs", "Live", "Live", "Live"]
    image = bpy.data.images["Lightmap"]
    assert image.size[:] == (40, 40)
    shown = settle(operator, context).copy()
    lamp.data.energy = 40
    assert settle(operator, context).sum() == pytest.approx(4 * shown.sum(), rel=0.02)
    operator.invoke(context, None)
    assert drive(operator, context) == {"FINISHED"} and window.is_as_before()


def test_render_meshes_are_read_once_while_nothing_changes(operator, context, window, monkeypatch):  # noqa: F811
    """Reading them links an object and changes the engine: Live must not follow these changes."""
    import bpy

    lit_room()
    box = mesh_object("Box", np.array(CUBE) * 0.3 + 0.1, [face[::-1] for face in INWARD])
    box.hemibake.role = "NO_LIGHTMAP"
    box.modifiers.new("Subdivision", "SUBSURF").render_levels = 2
    box.hide_set(True)
    start(operator, context)
    settle(operator, context)
    reads, live_run = [], part("operators.live_run")
    read = live_run.read_scene
    monkeypatch.setattr(
        live_run, "read_scene", lambda *args, **named: reads.append(1) or read(*args, **named)
    )
    for _ in range(9):
        bpy.context.view_layer.update()
        operator.modal(context, TIMER)
    assert not reads
    lit = settle(operator, context).copy()
    moves, read_moved = [], live_run.read_moved
    monkeypatch.setattr(live_run, "read_moved", lambda *args: moves.append(list(reads)) or read_moved(*args))
    box.location.x = 0.2
    assert not np.allclose(settle(operator, context), lit, atol=0.01)

    # Where it is shows at once; what renders make of it is read when the light has settled.
    assert moves == [[]] and reads == [1]
    operator.invoke(context, None)
    assert drive(operator, context) == {"FINISHED"} and window.is_as_before()
