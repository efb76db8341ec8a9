"""Two windows with scenes that share an object: the preview follows the pointer into the other window."""

import pytest

from tools.gui.window import WIDTH

#: Two scenes with a floor in both, which has a lightmap in each; the second scene has a window of its own.
STAGE = """
import sys
records = sys.modules[f"{MODULE}.operators.scene.bake_records"]
view = view3d()
with bpy.context.temp_override(**view):
    bpy.ops.mesh.primitive_plane_add(size=2)
    floor, first = bpy.context.object, view["window"].scene
    floor.name = "Shared"
    second = bpy.data.scenes.new("Second")
    second.collection.objects.link(floor)
    for scene in (first, second):
        entry = scene.hemibake.lightmaps.add()
        entry.name, entry.image = "Shared", bpy.data.images.new(f"Of {scene.name}", 4, 4, float_buffer=True)
        records.claim_bake_id(scene)
        record = records.writable_record(floor, scene)
        record.image, record.uv_layer = entry.image, "UVMap"
    view["area"].spaces.active.shading.type = "SOLID"
    preview = sys.modules[f"{MODULE}.operators.result.preview"]
    preview.show_preview(first, bpy.context.evaluated_depsgraph_get())
    bpy.ops.wm.window_new_main()
    bpy.context.window_manager.windows[-1].scene = second
    bpy.ops.ed.undo_push(message="Stage")
"""

WINDOWS = "len(bpy.context.window_manager.windows)"
SHOWN = (
    "[node.image.name for slot in bpy.data.objects['Shared'].material_slots if slot.material"
    " for node in slot.material.node_tree.nodes if node.type == 'TEX_IMAGE'] == ['Of {}']"
)

#: A pixel of each window: the second one is moved to the right half of the screen, above the first one.
LEFT, RIGHT = (300, 450), (1100, 450)


@pytest.fixture(scope="module", autouse=True)
def windows(window):
    """Open two windows, and close the second one at the end."""
    window.run(STAGE)
    window.wait_for(f"{WINDOWS} == 2")
    window.move_second_window(WIDTH // 2, 0)
    yield
    window.run(
        "with bpy.context.temp_override(window=bpy.context.window_manager.windows[-1]):\n"
        "    bpy.ops.wm.window_close()"
    )


def move_to(window, place, scene):
    """Move the pointer to a place, and wait until the lightmaps of a scene are shown."""
    for step in range(3):
        window.move(place[0] + 5 * step, place[1])
        window.ask("None")
    window.wait_for(SHOWN.format(scene))


def test_the_preview_follows_the_pointer(window):
    for place, scene in ((LEFT, "Scene"), (RIGHT, "Second"), (LEFT, "Scene")):
        move_to(window, place, scene)


def test_the_pointer_keeps_the_undo_history(window):
    """A redo is left after the switch, and undo and redo show the same lightmaps."""
    move_to(window, LEFT, "Scene")
    height = "bpy.data.objects['Shared'].location.z"
    inside = "with bpy.context.temp_override(**view3d()):\n    "
    window.run(f"{height} = 1.0")
    window.run(f"{inside}bpy.ops.ed.undo_push(message='Lift')")
    window.run(f"{inside}bpy.ops.ed.undo()")
    move_to(window, RIGHT, "Second")
    for step, wanted in (("redo", 1.0), ("undo", 0.0), ("redo", 1.0), ("undo", 0.0)):
        window.run(f"{inside}bpy.ops.ed.{step}()")
        assert window.ask(height) == wanted
        window.wait_for(SHOWN.format("Second"))
    move_to(window, LEFT, "Scene")


def test_a_disabled_add_on_leaves_no_key(window):
    """Disabling also restores the materials."""
    left = (
        "[item.idname for item in bpy.context.window_manager.keyconfigs.addon.keymaps['Window'].keymap_items"
        " if 'hemibake' in item.idname]"
    )
    assert window.ask(left) == ["hemibake.follow_window"]
    window.run("bpy.ops.preferences.addon_disable(module=MODULE)")
    assert window.ask(left) == []
    window.move(*RIGHT)
    window.run("bpy.ops.preferences.addon_enable(module=MODULE)")
    assert window.ask(left) == ["hemibake.follow_window"]
