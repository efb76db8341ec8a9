"""A user's first workflow in a real window, by mouse and keyboard, checked after each step."""

import pytest

from tools.gui.window import wait_until

#: Makes the Bake button look as if nothing could be baked, and as it was.
BAKE = (
    "import sys\n"
    "bake = sys.modules[f'{MODULE}.operators.bake'].HEMIBAKE_OT_bake\n"
    "bake.kept, bake.poll = bake.__dict__['poll'], classmethod(lambda cls, context: False)",
    "import sys\nbake = sys.modules[f'{MODULE}.operators.bake'].HEMIBAKE_OT_bake\nbake.poll = bake.kept",
)

#: Makes the Preview button look pressed where it is not, and the other way round.
PREVIEW = (
    "import sys\n"
    "panel = sys.modules[f'{MODULE}.panels.bake']\n"
    "panel.kept = panel.shows_preview\n"
    "panel.shows_preview = lambda scene, shown=panel.kept(bpy.context.scene): not shown",
    "import sys\npanel = sys.modules[f'{MODULE}.panels.bake']\npanel.shows_preview = panel.kept",
)

#: The default scene on a floor, shown by Cycles: EEVEE compiles shaders for minutes where software draws.
STAGE = """
with bpy.context.temp_override(**view3d()):
    bpy.ops.mesh.primitive_plane_add(size=6, location=(0, 0, -1))
    bpy.context.scene.render.engine, bpy.context.scene.cycles.preview_samples = "CYCLES", 4
    shading = view3d()["area"].spaces.active.shading
    shading.type, shading.use_scene_lights, shading.use_scene_world = "RENDERED", True, True
    settings = bpy.context.scene.hemibake
    settings.resolution, settings.show_when_done = 1024, False
    bpy.ops.ed.undo_push(message="Stage")
"""

RUNNING = "__import__('sys').modules[f'{MODULE}.operators.worker_manager'].owner.busy"
IMAGE = "bpy.data.images.get('Lightmap')"
SLOTS = "[obj.material_slots[0].material.name for obj in (bpy.data.objects['Cube'],)]"
SHOWN = "[slot.material.name for slot in bpy.data.objects['Plane'].material_slots]"
LIGHT = "sum(bpy.data.images['Lightmap'].pixels) / len(bpy.data.images['Lightmap'].pixels)"


@pytest.fixture(scope="module", autouse=True)
def stage(window, keep):
    window.run(STAGE)
    keep("before")


def bake(window):
    """Click Bake, and wait until the bake runs."""
    window.click(*window.button(*BAKE))
    window.wait_for(RUNNING)


def bake_to_the_end(window):
    bake(window)
    window.wait_for(f"not {RUNNING}")


def state(window):
    """Return what a cancelled bake must leave as it was."""
    return window.ask(
        "[sorted(image.name for image in bpy.data.images), bpy.context.scene.hemibake.report,"
        " [[layer.name for layer in mesh.uv_layers] for mesh in bpy.data.meshes], "
        f"{SLOTS}, bpy.context.mode, sorted(obj.name for obj in bpy.context.selected_objects)]"
    )


def test_escape_over_the_view_cancels(window, keep):
    before = state(window)
    bake(window)
    keep("baking")
    window.move(*window.middle())
    window.key("Escape")
    window.wait_for(f"not {RUNNING}")
    keep("cancelled")
    assert state(window) == before


def test_bake_fills_the_lightmap(window, keep):
    window.run("bpy.context.scene.hemibake.resolution = 128")
    bake_to_the_end(window)
    keep("baked")
    assert window.ask(f"{IMAGE}.size[:]") == [128, 128]
    assert window.ask(LIGHT) > 0.01
    assert window.ask("bpy.context.scene.hemibake.report") and window.ask(SHOWN) == []


def test_preview_is_shown_and_an_undo_takes_it_back(window, keep):
    materials = window.ask(SLOTS)
    window.click(*window.button(*PREVIEW))
    window.wait_for(f"{SHOWN} != []")
    keep("preview")
    assert window.ask(SLOTS) == [f"{name} (lightmap)" for name in materials]
    window.move(*window.middle())
    window.key("ctrl+z")
    window.wait_for(f"{SHOWN} == []")
    keep("undone")
    assert window.ask(SLOTS) == materials and window.ask(LIGHT) > 0.01
    window.key("ctrl+shift+z")
    window.wait_for(f"{SHOWN} != []")


def test_open_render_shows_the_light_of_the_next_bake(window, keep):
    """In the preview a rendered view changes only with the lightmap."""
    window.run("bpy.data.lights[0].energy *= 0.1")
    x, y = (round(value) for value in window.ask("pixel_of((0, 0, 1))"))

    def brightness():
        return window.picture()[y - 5 : y + 5, x - 5 : x + 5].mean()

    before = brightness()
    bake_to_the_end(window)
    wait_until(lambda: brightness() < 0.7 * before, "the render is darker")
    keep("darker")


def test_saved_and_opened_again_everything_is_there(window, keep):
    window.run(f"bpy.ops.wm.save_as_mainfile(filepath={str(window.folder / 'scene.blend')!r})")
    bake_to_the_end(window)
    window.move(*window.middle())
    window.key("ctrl+s")
    window.wait_for("not bpy.data.is_dirty")
    light = window.ask(LIGHT)
    window.run("bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)")
    assert window.ask(SHOWN) != [] and window.ask(LIGHT) == pytest.approx(light)
    assert window.ask(f"bpy.path.abspath({IMAGE}.filepath)").endswith("lightmaps/scene_Lightmap.exr")
    keep("opened again")
    window.click(*window.button(*PREVIEW))
    window.wait_for(f"{SHOWN} == []")
    keep("without preview")
    assert "Traceback" not in window.console()
