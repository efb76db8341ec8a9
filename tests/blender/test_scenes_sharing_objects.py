"""Scenes that share objects keep lightmaps of their own, and the preview follows the scene of the window."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.blender.things import material, part, pixels, square


def sun(scene, strength):
    import bpy

    light = bpy.data.lights.new(f"Sun {scene.name}", "SUN")
    light.energy = strength
    scene.collection.objects.link(bpy.data.objects.new(light.name, light))


def show_scene(scene):
    import bpy

    bpy.context.window.scene = scene
    scene.objects["Floor"].location = scene.objects["Floor"].location
    bpy.context.view_layer.update()


def bake(scene):
    import bpy

    bpy.context.window.scene = scene
    settings = scene.hemibake
    settings.resolution, settings.samples, settings.target = 16, 16, "ALL"
    bpy.ops.hemibake.bake()


def light_shown(obj):
    """Return the mean light of the image that an object's preview material shows; None without one."""
    (slot,) = obj.material_slots
    tree = slot.material.node_tree
    images = [node.image for node in tree.nodes if node.type == "TEX_IMAGE"]
    return shown_mean(images[0]) if images else None


def image_of(scene):
    """Return the lightmap of a scene."""
    return scene.hemibake.lightmaps["Lightmap"].image


def shown_mean(image):
    texels = pixels(image)[..., 0]
    return float(texels[texels > 0].mean())


@pytest.fixture
def scenes():
    """Return two scenes that share a floor, and the floor: suns of pi and 3 pi give light of 1 and 3."""
    import bpy

    first, second = bpy.context.scene, bpy.data.scenes.new("Evening")
    floor = square("Floor", surface=material("Grey"))
    lone = square("Lone", surface=material("Lone"))
    lone.location.x = 40
    second.collection.objects.link(floor)
    sun(first, np.pi)
    sun(second, 3 * np.pi)
    return first, second, floor


def test_preview_follows_the_scene_of_the_window(scenes):
    import bpy

    first, second, floor = scenes
    bake(first)
    bake(second)
    bpy.context.window.scene = first
    bpy.ops.hemibake.preview()
    assert light_shown(floor) == pytest.approx(1, rel=0.02)
    show_scene(second)
    assert light_shown(floor) == pytest.approx(3, rel=0.02)
    show_scene(first)
    assert light_shown(floor) == pytest.approx(1, rel=0.02)
    bpy.ops.hemibake.preview()
    assert floor.material_slots[0].material == bpy.data.materials["Grey"]


def test_a_second_window_shows_the_lightmaps_of_its_scene_at_a_click(scenes):
    """Blender reports no change of the active window; the button of each window belongs to its scene."""
    import bpy

    first, second, floor = scenes
    bake(second)
    bake(first)
    bpy.ops.hemibake.preview()
    shows_other = part("operators.result.preview").shows_other_scene
    for scene, light in ((second, 3), (first, 1), (second, 3)):
        assert shows_other(scene)
        with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
            bpy.ops.hemibake.preview()
        assert light_shown(floor) == pytest.approx(light, rel=0.02) and not shows_other(scene)
    with bpy.context.temp_override(scene=second, view_layer=second.view_layers[0]):
        bpy.ops.hemibake.preview()
    assert floor.material_slots[0].material == bpy.data.materials["Grey"]


@pytest.fixture
def switch(scenes):
    """Return the module that follows the pointer; both scenes are baked, and the second one is shown."""
    import bpy

    module = part("operators.preview_switch")
    for scene in scenes[:2]:
        bake(scene)
    bpy.ops.hemibake.preview()
    module._shown.forget()
    yield module
    module._timer.stop()
    module._shown.forget()


def move_to(switch, scene):
    """Move the pointer twice in a window of a scene, one of two windows; return the call that waits."""
    import bpy

    bpy.context.window.scene = scene
    window = SimpleNamespace(as_pointer=lambda: scene.session_uid)
    manager = SimpleNamespace(windows=(window, None))
    context = SimpleNamespace(window_manager=manager, window=window, scene=scene)
    operator = switch.HEMIBAKE_OT_follow_window
    for _ in range(2):
        if operator.poll(context):
            assert operator.invoke(None, context, None) == {"PASS_THROUGH"}
    waiting = switch._timer._call
    return waiting if waiting is not None and bpy.app.timers.is_registered(waiting) else None


def test_the_preview_follows_a_pointer_that_stays(scenes, switch):
    """A pointer that has moved on switches nothing, and disabling the add-on drops what waits."""
    import bpy

    first, second, floor = scenes
    crossed = move_to(switch, first)
    move_to(switch, second)
    assert crossed() is None and light_shown(floor) == pytest.approx(3, rel=0.02)
    stays = move_to(switch, first)
    assert stays() is None and light_shown(floor) == pytest.approx(1, rel=0.02)
    back = move_to(switch, second)
    switch._timer.stop()
    assert not bpy.app.timers.is_registered(back)


def test_a_pointer_disturbs_no_bake_and_no_modal_operator(scenes, switch, monkeypatch):
    first, _, floor = scenes
    running = part("operators.worker_manager").owner
    monkeypatch.setattr(running, "running", object())
    assert move_to(switch, first) is None and switch._shown.active is None
    running.running = None
    waiting = move_to(switch, first)
    running.running = object()
    assert waiting() > 0 and light_shown(floor) == pytest.approx(3, rel=0.02)
    running.running = None
    names = ["TRANSFORM_OT_translate", "HEMIBAKE_OT_bake"]
    modal = SimpleNamespace(modal_operators=[SimpleNamespace(bl_idname=name) for name in names])
    manager = SimpleNamespace(windows=[modal])
    with monkeypatch.context() as patch:
        patch.setattr(switch, "bpy", SimpleNamespace(context=SimpleNamespace(window_manager=manager)))
        assert waiting() > 0
        del modal.modal_operators[0]
        assert not switch._is_modal()
    assert waiting() is None and light_shown(floor) == pytest.approx(1, rel=0.02)


def test_an_undo_frees_no_preview_in_use(scenes, switch):
    """A switch by the pointer has no undo step, so the preview is set aside, also on unshared objects."""
    import bpy

    first, second, floor = scenes
    grey, lone = bpy.data.materials["Grey"], bpy.data.objects["Lone"]
    for scene in (first, second):
        move_to(switch, scene)()
    assert switch._shown.followed == [first.session_uid, second.session_uid]
    assert light_shown(lone) == pytest.approx(1, rel=0.02)
    for before, after in (("undo_pre", "undo_post"), ("redo_pre", "redo_post")):
        for handler in getattr(bpy.app.handlers, before):
            handler(second)
        assert floor.material_slots[0].material == grey
        assert lone.material_slots[0].material == bpy.data.materials["Lone"]
        for handler in getattr(bpy.app.handlers, after):
            handler(second)
        switch._timer._call()
        assert light_shown(floor) == pytest.approx(3, rel=0.02)
    switch.follow_again()
    switch._expect_undo()
    assert light_shown(floor) == pytest.approx(3, rel=0.02)


def test_scene_without_a_bake_shows_materials_until_it_is_left(scenes):
    import bpy

    first, second, floor = scenes
    bake(first)
    bpy.ops.hemibake.preview()
    show_scene(second)
    second.hemibake.show_when_done = False
    assert floor.material_slots[0].material == bpy.data.materials["Grey"]
    bake(second)
    show_scene(first)
    assert light_shown(floor) == pytest.approx(1, rel=0.02)


def test_scenes_keep_what_they_know_of_an_object(scenes):
    first, second, floor = scenes
    records = part("operators.scene.bake_records")
    bake(first)
    assert records.bake_record(floor, second).image is None
    bake(second)
    images = [records.bake_record(floor, scene).image for scene in (first, second)]
    assert images == [image_of(first), image_of(second)]
    assert images[0] != images[1]
    first.name = "Noon"
    assert records.bake_record(floor, first).image == images[0]


def test_changed_objects_are_those_of_the_scene(scenes):
    import bpy

    first, second, _ = scenes
    bake(first)
    bake(second)
    bpy.context.window.scene, first.hemibake.target = first, "CHANGED"
    with pytest.raises(RuntimeError, match="Nothing has changed"):
        bpy.ops.hemibake.bake()


def test_export_takes_lightmaps_of_the_active_scene(scenes, tmp_path):
    import bpy

    first, second, _ = scenes
    bake(first)
    bake(second)
    for scene, light in ((first, 1), (second, 3)):
        show_scene(scene)
        path = tmp_path / f"{light}.glb"
        bpy.ops.hemibake.export_for_engine(filepath=str(path))
        (name,) = {item.name for item in tmp_path.iterdir()} & {f"{light}.{image_of(scene).name}.exr"}
        loaded = bpy.data.images.load(str(tmp_path / name))
        assert shown_mean(loaded) == pytest.approx(light, rel=0.02)


def test_copy_of_a_scene_shows_its_lightmaps_until_it_is_baked(scenes):
    first, _, floor = scenes
    records = part("operators.scene.bake_records")
    bake(first)
    copy = first.copy()
    image = records.bake_record(floor, first).image
    assert image is not None and records.bake_record(floor, copy).image == image
    sun(copy, 4 * np.pi)
    bake(copy)
    assert records.bake_record(floor, first).image == image
    assert shown_mean(image) == pytest.approx(1, rel=0.02)
    assert shown_mean(records.bake_record(floor, copy).image) == pytest.approx(5, rel=0.02)
    lone = first.objects["Lone"]
    assert records.bake_record(lone, first).image == image


def test_records_of_a_deleted_scene_are_removed(scenes):
    import bpy

    first, second, floor = scenes
    bake(first)
    bake(second)
    assert len(floor.hemibake.other_bakes) == 1
    bpy.data.scenes.remove(second)
    bake(first)
    assert not floor.hemibake.other_bakes


def test_an_appended_object_brings_its_lightmap_and_no_scene(scenes, tmp_path):
    import bpy

    first, second, _ = scenes
    bake(first)
    bake(second)
    path = str(tmp_path / "scenes.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(path) as (_, into):
        into.objects = ["Floor"]
    (appended,) = into.objects
    bpy.context.scene.collection.objects.link(appended)
    record = part("operators.scene.bake_records").bake_record(appended, bpy.context.scene)
    assert len(bpy.data.scenes) == 1 and shown_mean(record.image) == pytest.approx(1, rel=0.02)
