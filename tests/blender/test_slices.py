"""A run unwraps and reads between events: edits meanwhile are detected, freed data is not used."""

import time

import numpy as np
import pytest

from tests.blender.things import (
    CUBE,
    INWARD,
    furnace,
    material,
    mesh_object,
    part,
    pixels,
    snapshot,
    square,
)
from tests.rows import long


def noisy():
    """Return a material that only Cycles can evaluate."""
    result = material("Noise")
    tree = result.node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    return result


def room():
    """Return the furnace, and a square that is painted by nodes in an atlas of its own."""
    import bpy

    walls, painted = furnace(), square("Painted", surface=noisy())
    painted.hemibake.atlas = "Own"
    for step in range(2):
        painted.location.z = step
        bpy.ops.ed.undo_push(message=f"Moved to {step}")
    return walls, painted


@pytest.fixture(autouse=True)
def short_slices(monkeypatch):
    """Yield wherever that is possible."""
    monkeypatch.setattr(part("operators.scene.slice_timer"), "_SLICE", 0.0)
    monkeypatch.setattr(part("engine.progress"), "_STEP", 0.0)


@pytest.fixture
def quick_cycles(monkeypatch):
    """Let Cycles see everything grey at once; all that is made for it is made."""
    stage = part("operators.scene.materials.shader_bake")._Stage

    def grey(self, size):
        return np.full((size, size, 3), 0.5, np.float32), np.ones((size, size), bool)

    monkeypatch.setattr(stage, "bake", grey)


def new_run():
    import bpy

    return part("operators.bake_run").BakeRun(bpy.context, part("engine").bake)


def steps_of_reading() -> int:
    """Return after how many steps the bake of the room begins."""
    run, steps = new_run(), 0
    stages = set()
    while "Preparing texels" not in stages:
        progress = run.step()
        steps += 1
        if progress is not None:
            stages.add(progress.stage)
    run.cancel()
    assert {"Unwrapping", "Reading objects", "Reading material 'Noise' with Cycles"} <= stages
    return steps


def test_cancel_at_any_step_leaves_nothing_behind(quick_cycles):
    room()
    before, count = snapshot(), steps_of_reading()
    for steps in range(0, count, max(count // 23, 1)):
        run = new_run()
        for _ in range(steps):
            # How often the process that unwraps is asked differs from run to run.
            progress = run.step()
            if progress is not None and progress.stage == "Preparing texels":
                break
        run.cancel()
        assert snapshot() == before, steps


def test_progress_of_a_whole_run_never_falls_and_ends_at_one():
    room()
    run, seen = new_run(), []
    run.finish(run.run_to_end(seen.append))
    overall = [progress.overall for progress in seen]
    assert overall == sorted(overall) and overall[-1] <= 1
    assert seen[0].stage == "Unwrapping" and seen[-1].stage == "Saving"


def until(run, stage):
    """Do steps until a stage has begun."""
    while (progress := run.step()) is None or progress.stage != stage:
        pass


def delete(furnace, painted):
    import bpy

    bpy.data.objects.remove(painted)


def hide(furnace, painted):
    painted.hide_render = True


def edit(furnace, painted):
    import bpy

    bpy.context.view_layer.objects.active = furnace
    bpy.ops.object.mode_set(mode="EDIT")


def add_modifier(furnace, painted):
    painted.modifiers.new("Array", "ARRAY")


def undo(furnace, painted):
    import bpy

    bpy.ops.ed.undo()


def repaint(furnace, painted):
    import bpy

    bpy.data.materials["Noise"].node_tree.nodes["Noise Texture"].inputs["Scale"].default_value = 0.1


def open_a_window_of_another_scene(furnace, painted):
    import bpy

    bpy.data.scenes.new("Other")


CHANGES = [delete, hide, edit, add_modifier, undo, repaint, open_a_window_of_another_scene]


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("stage", ["Reading objects", long("Reading material 'Noise' with Cycles")])
def test_scene_that_changes_while_it_is_read_is_baked_as_it_is_then(change, stage, quick_cycles):
    import bpy

    if change is undo:
        bpy.ops.ed.undo_push(message="Empty")
    walls, painted = room()
    run = new_run()
    until(run, stage)
    run.step()
    change(walls, painted)
    report = run.finish(run.run_to_end())
    walls = bpy.data.objects["Furnace"]
    gone = change in (delete, hide)
    named = [note for note in report["warnings"] if "Deleted or hidden" in str(note)]
    assert bool(named) == gone and all("'Painted'" in str(note) for note in named)
    assert report["objects"] == (1 if gone else 2)
    assert np.isfinite(pixels(bpy.data.images["Lightmap"])).all()
    assert walls.hemibake.image == bpy.data.images["Lightmap"] and len(walls.data.uv_layers) == 1


def test_scene_that_changes_all_the_time_is_baked_all_the_same(quick_cycles):
    walls, _ = room()
    run, count = new_run(), 0
    while True:
        try:
            progress = run.step()
        except StopIteration as end:
            lightmap = end.value
            break
        if progress is not None and progress.stage.startswith("Reading"):
            count += 1
            walls.location.x = 0.01 * count
    assert run.finish(lightmap)["objects"] == 2 and count >= 3


def test_scene_that_is_removed_while_it_is_read_is_an_error():
    import bpy

    room()
    other = bpy.data.scenes.new("Other")
    run = new_run()
    until(run, "Reading objects")
    bpy.context.window.scene = other
    bpy.data.scenes.remove(bpy.data.scenes["Scene"])
    with pytest.raises(part("engine.errors").SceneError, match="gone. Bake again"):
        run.run_to_end()
    run.cancel()


def test_no_handler_stays_after_a_run_however_it_ends():
    import bpy

    def handlers():
        names = ("depsgraph_update_post", "undo_post", "redo_post")
        return [list(getattr(bpy.app.handlers, name)) for name in names]

    room()
    before = handlers()
    run = new_run()
    while handlers() == before:
        run.step()
    run.cancel()
    assert handlers() == before
    run = new_run()
    run.finish(run.run_to_end())
    assert handlers() == before


def test_large_mesh_is_announced_and_read_as_a_small_one_is():
    import bpy

    bpy.ops.mesh.primitive_grid_add(x_subdivisions=180, y_subdivisions=180)
    obj = bpy.context.object
    obj.data.uv_layers["UVMap"].name = "Lightmap"
    mesh_object("Cube", CUBE, INWARD)
    scene = part("operators.scene")
    context = scene.SceneContext(bpy.context)
    stages, work = [], scene.read_scene(context, [obj], "Lightmap", 64)
    while True:
        try:
            progress = next(work)
        except StopIteration as end:
            read = end.value
            break
        stages += [] if progress is None else [progress.stage]
    assert stages.count(f"Reading object '{obj.name}'") == 1
    grid, cube = read.scene.meshes
    assert grid.positions.shape == (2 * 180**2, 3, 3) and len(cube.positions) == 12
    edges = grid.positions[:, 1:] - grid.positions[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum() / 2
    assert area == pytest.approx(4, rel=1e-5)
    assert (np.diff(grid.face) >= 0).all() and grid.face[-1] == 180**2 - 1
    assert sorted(set(grid.subface.tolist())) == [0, 1]


def test_a_slice_lasts_at_least_as_long_as_its_start_took():
    """Blender iterates over all earlier instances before a slice: short slices would take quadratic time."""
    short, long = (part("operators.scene.slice_timer").Slice(least) for least in (0.0, 60.0))
    time.sleep(0.01)
    assert short.over and not long.over
