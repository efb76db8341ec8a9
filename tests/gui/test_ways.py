"""Longer workflows in a real window: light groups, resumed bakes, bakes of changed objects."""

import json

import pytest

from tests.gui.test_window import BAKE, LIGHT, PREVIEW, RUNNING

#: A scene of two lamps, of which one is in a light group. The sidebar stands beside the 3D view: what is
#: found in it by its looks does not lie over a render.
STAGE = """
bpy.ops.wm.read_homefile(load_ui=False)
bpy.context.preferences.view.show_splash = False
bpy.context.preferences.system.use_region_overlap = False
with bpy.context.temp_override(**view3d()):
    bpy.ops.mesh.primitive_plane_add(size=6, location=(0, 0, -1))
    bpy.ops.object.light_add(type="POINT", location=(-1.5, -1.5, 2))
    scene, lamp = bpy.context.scene, bpy.context.object
    lamp.name, lamp.data.energy = "Warm", 300
    bpy.context.view_layer.lightgroups.add(name="Warm & near")
    lamp.lightgroup = "Warm & near"
    scene.render.engine, scene.cycles.preview_samples = "CYCLES", 4
    shading = view3d()["area"].spaces.active.shading
    shading.type, shading.use_scene_lights, shading.use_scene_world = "RENDERED", True, True
    scene.hemibake.resolution, scene.hemibake.show_when_done = 64, False
    scene.hemibake.makes_light_groups = True
    bpy.ops.ed.undo_push(message="Stage")
"""

#: Makes the Live button look pressed where it is not, and the other way round.
LIVE = (
    "import sys\n"
    "panel = sys.modules[f'{MODULE}.panels.bake']\n"
    "panel.kept = panel.is_live\n"
    "panel.is_live = lambda shown=panel.kept(): not shown",
    "import sys\npanel = sys.modules[f'{MODULE}.panels.bake']\npanel.is_live = panel.kept",
)

MIXER = "bpy.context.scene.hemibake.light_mixer"
STRENGTH = f"{MIXER}.nodes['Warm & near Strength'].outputs[0].default_value"
REPORT = "__import__('json').loads(bpy.context.scene.hemibake.report)"
PREFERENCES = "bpy.context.preferences.addons[MODULE].preferences"
KEPT = "__import__('sys').modules[f'{MODULE}.operators.user_files'].kept_checkpoint_since"
OWNER = "__import__('sys').modules[f'{MODULE}.operators.worker_manager'].owner"
SETTLED = f"{OWNER}.running.following and {OWNER}.running.run.converged"
FAILURE = "__import__('sys').modules[f'{MODULE}.operators.last_bake'].last_failure.of(bpy.context.scene)"


@pytest.fixture(scope="module", autouse=True)
def stage(window):
    # A small scale, so that the sidebar shows the mixer without scrolling.
    window.run(f"{STAGE}\nbpy.context.preferences.view.ui_scale = 0.6")
    yield
    window.run("bpy.context.preferences.view.ui_scale = 1")

    # The view stays as it is, and EEVEE, which new files have, must not draw in it: see test_window.
    window.run(
        "view3d()['area'].spaces.active.shading.type = 'SOLID'\n"
        "bpy.ops.wm.read_homefile(load_ui=False)\n"
        "bpy.context.preferences.system.use_region_overlap = True"
    )


def bake_to_the_end(window):
    """Click Bake, and wait for a new report: a quick bake is over before anybody asks whether it runs."""
    window.run("bpy.context.scene.hemibake.report = ''")
    window.click(*window.button(*BAKE))
    window.wait_for(f"bpy.context.scene.hemibake.report and not {RUNNING}")


def floor_light(window):
    """Return how bright a place on the floor is that the lamp in the group shines on."""
    x, y = (round(value) for value in window.ask("pixel_of((-1.6, -1.6, -1))"))
    return window.still_picture()[y - 5 : y + 5, x - 5 : x + 5].mean()


def test_mixer_changes_the_preview_takes_keyframes_and_is_saved(window, keep):
    bake_to_the_end(window)
    window.click(*window.button(*PREVIEW))
    window.wait_for(f"{MIXER} is not None")
    keep("light groups")
    before = floor_light(window)

    # Type the strength into its field, which lies beside the colour.
    x, y = window.button(f"{STRENGTH} = 0.25", f"{STRENGTH} = 1.0")
    window.click(x, y)
    window.key("ctrl+a")
    window.key("0")
    window.key("Return")
    window.wait_for(f"{STRENGTH} == 0")
    assert floor_light(window) < 0.7 * before
    keep("without a group")

    # A key over the field is a keyframe of it.
    for frame, value in ((1, 0.0), (11, 2.0)):
        window.run(f"bpy.context.scene.frame_set({frame}); {STRENGTH} = {value}; redraw()")
        window.move(x, y)
        window.picture()
        window.key("i")
        keys = f"[len(curve.keyframe_points) for curve in {MIXER}.animation_data.action.fcurves]"
        window.wait_for(f"{MIXER}.animation_data and {keys} == [{1 if frame == 1 else 2}]")
    window.run("bpy.context.scene.frame_set(6); redraw()")
    assert window.ask(STRENGTH) == pytest.approx(1.0)
    assert floor_light(window) > 0.8 * before

    path = str(window.folder / "groups.blend")
    window.run(f"bpy.ops.wm.save_as_mainfile(filepath={path!r})\nbpy.ops.wm.open_mainfile(filepath={path!r})")
    window.run("bpy.context.scene.frame_set(1); redraw()")
    assert window.ask(STRENGTH) == 0 and floor_light(window) < 0.7 * before
    keep("groups opened again")


def test_renamed_group_shows_in_the_open_preview(window, keep):
    window.run("bpy.context.view_layer.lightgroups['Warm & near'].name = 'Dusk'")
    bake_to_the_end(window)
    assert window.ask(f"[item.name for item in {MIXER}.interface.items_tree][1:]") == ["Dusk", "Ungrouped"]
    keep("renamed group")


def test_cancelled_bake_goes_on_and_says_so(window, keep):
    window.run(
        f"{PREFERENCES}.checkpoint_interval = 0.5\n"
        "settings = bpy.context.scene.hemibake\n"
        "settings.outputs, settings.resolution, settings.quality = {'combined'}, 200, 'high'"
    )
    began = window.ask("__import__('time').time()")
    window.click(*window.button(*BAKE))
    window.wait_for(f"{KEPT}({began})")
    window.move(*window.middle())
    window.key("Escape")
    window.wait_for(f"not {RUNNING}")
    keep("cancelled, goes on")
    bake_to_the_end(window)
    (sentence, *_) = window.ask(f"{REPORT}['resumed']")
    assert "restored from an interrupted bake" in sentence
    keep("went on")


def test_bake_of_changed_objects_names_them(window, keep):
    window.run(
        f"{PREFERENCES}.checkpoint_interval = 5\n"
        "settings = bpy.context.scene.hemibake\n"
        "settings.resolution, settings.quality = 64, 'preview'"
    )
    bake_to_the_end(window)
    before = window.ask(LIGHT)
    window.run("bpy.context.scene.hemibake.target = 'CHANGED'\nbpy.data.objects['Warm'].data.energy *= 2")
    bake_to_the_end(window)
    told = json.dumps(window.ask(f"{REPORT}['warnings']"))
    assert "may have changed" in told and "'Cube'" in told and "'Plane'" in told
    assert window.ask(LIGHT) > 1.2 * before
    keep("changed light")
    window.click(*window.button(*BAKE))
    window.wait_for(f"not {RUNNING} and 'Nothing has changed' in {FAILURE}")
    keep("nothing has changed")
    assert "Traceback" not in window.console()


def test_live_follows_a_lamp_and_a_mesh_until_its_button_is_clicked_again(window, keep):
    window.run("bpy.context.scene.hemibake.target = 'ALL'")
    window.click(*window.button(*LIVE))
    window.wait_for(f"{RUNNING} and {SETTLED}")
    before = window.ask(LIGHT)
    keep("live")
    window.run("bpy.data.objects['Warm'].data.energy *= 3")
    window.wait_for(f"{LIGHT} > {1.5 * before} and {SETTLED}")
    brighter = window.ask(LIGHT)
    keep("live, brighter")

    # The floor comes into the shadow of the cube, and out of that below the cube.
    window.run("bpy.data.objects['Cube'].location = (-1.5, -1.5, 0.5)")
    window.wait_for(f"abs({LIGHT} - {brighter}) > {0.1 * brighter} and {SETTLED}")
    keep("live, moved")
    moved = window.ask(LIGHT)
    window.click(*window.button(*LIVE))
    window.wait_for(f"not {RUNNING}")
    assert window.ask(LIGHT) == pytest.approx(moved)
    assert window.ask(f"{REPORT}['objects']") == 2 and "Traceback" not in window.console()
    keep("after live")
    bake_to_the_end(window)
    assert window.ask(LIGHT) == pytest.approx(moved, rel=0.02)


def test_live_ends_where_another_file_is_opened_and_has_stored_its_light(window, keep):
    path = str(window.folder / "followed.blend")
    window.run("view3d()['area'].spaces.active.shading.type = 'SOLID'")
    window.run(f"bpy.ops.wm.save_as_mainfile(filepath={path!r})")
    window.click(*window.button(*LIVE))
    window.wait_for(f"{RUNNING} and {SETTLED}")
    window.run("view3d()['area'].spaces.active.shading.type = 'SOLID'")
    before = window.ask(LIGHT)
    window.run("bpy.data.objects['Warm'].data.energy *= 3")
    window.wait_for(f"{LIGHT} > {1.5 * before} and {SETTLED}")
    shown, file = window.ask(LIGHT), window.ask("bpy.data.images['Lightmap'].filepath_from_user()")
    window.run("bpy.ops.wm.read_homefile(load_ui=False)")
    assert not window.ask(RUNNING)
    window.run(f"bpy.data.images.load({file!r}).name = 'Lightmap'")
    assert window.ask(LIGHT) == pytest.approx(shown, rel=1e-5) and "Traceback" not in window.console()
    window.run(f"bpy.ops.wm.open_mainfile(filepath={path!r}, load_ui=False)")
    keep("opened again")
