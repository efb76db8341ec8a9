"""Check lists problems, fixes what it can on request, and changes nothing by itself."""

import json

import numpy as np
import pytest

from tests.blender.things import (
    CUBE,
    INWARD,
    SQUARE,
    SQUARE_UVS,
    finished,
    furnace,
    geometry_nodes,
    loop_uvs,
    material,
    mesh_object,
    part,
    pixels,
    report,
    shrink_charts,
    snapshot,
    square,
)

WHOLE = [(0, 0), (1, 0), (1, 1), (0, 1)]
FOLDED = [(0.1, 0.1), (0.9, 0.1), (0.1, 0.2), (0.9, 0.2)]
OUTWARD = [face[::-1] for face in INWARD]


def check():
    """Check the scene; return the findings that are kept with it."""
    import bpy

    before = snapshot()
    assert bpy.ops.hemibake.check() == {"FINISHED"}
    assert snapshot() == before
    return part("operators.checks").last_check(bpy.context.scene)


def finding(word):
    """Return the only finding with a word in it; None without one."""
    found = [one for one in check().findings if word in one.text]
    assert len(found) < 2
    return found[0] if found else None


def fix(found):
    """Press the button of a finding."""
    import bpy

    names = json.dumps(found.objects)
    return bpy.ops.hemibake.fix(fix=found.fix, names=names, value=found.value)


@pytest.fixture(autouse=True)
def light(monkeypatch):
    """Something that emits light, so that a scene in order has no findings, and no bake so far."""
    import bpy

    monkeypatch.setattr(part("operators.worker_manager").owner, "paces", {})
    lamp = bpy.data.lights.new("Lamp", "POINT")
    obj = bpy.data.objects.new("Lamp", lamp)
    obj.location.z = 3
    bpy.context.scene.collection.objects.link(obj)
    return obj


def test_scene_that_is_in_order_has_no_findings():
    square(surface=material())
    checked = check()
    assert checked.findings == ()
    assert checked.estimate.patches == pytest.approx(0.64 * 32**2, rel=0.1)
    assert checked.estimate.seconds > 0 and not checked.estimate.measured


def test_findings_survive_text():
    square("Folded", FOLDED)
    square("New", uvs=None)
    module = part("operators.check")
    checked = check()
    assert len(checked.findings) == 2 and module.Checked.from_json(checked.to_json()) == checked
    assert [one.severity for one in checked.findings] == ["ERROR", "INFO"]


def test_empty_scene_is_told_and_takes_no_time():
    checked = check()
    assert ["no mesh with faces" in one.text for one in checked.findings] == [True]
    assert checked.findings[0].severity == "ERROR" and checked.estimate is None


def test_uv_layer_without_a_name_is_told():
    import bpy

    square()
    bpy.context.scene.hemibake.uv_layer = ""
    assert finding("has no name").severity == "ERROR"


def test_missing_uvs_are_made():
    obj = square("New", uvs=None)
    found = finding("No lightmap UVs")
    assert (found.severity, found.objects) == ("INFO", ("New",))
    assert fix(found) == {"FINISHED"}
    assert "Lightmap" in obj.data.uv_layers and finding("lightmap UVs") is None


@pytest.mark.parametrize(
    "uvs", [FOLDED, [(0, 0)] + [(np.nan, 1)] * 3, np.array(FOLDED) * 7 - 3], ids=["folded", "NaN", "outside"]
)
def test_useless_uvs_are_replaced_by_a_layer_of_its_own(uvs):
    import bpy

    obj, other = square("Folded", uvs), square("Other", np.array(SQUARE_UVS) * 0.01)
    found = next(one for one in check().findings if one.fix)
    assert found.severity == "ERROR" and found.objects == ("Folded",)
    before = loop_uvs(obj)
    assert fix(found) == {"FINISHED"}
    assert [layer.name for layer in obj.data.uv_layers] == ["Lightmap", "Lightmap.001"]
    assert obj.hemibake.own_uv_layer == "Lightmap.001" and other.hemibake.own_uv_layer == ""
    np.testing.assert_array_equal(loop_uvs(obj), before)
    assert not [one for one in check().findings if one.severity == "ERROR"]
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    assert report()["objects"] == 2


def test_objects_that_are_placed_side_by_side_are_named():
    square("First", WHOLE)
    square("Second", WHOLE)
    square("Alone", WHOLE).hemibake.atlas = "Other"
    found = finding("moves them apart")
    assert (found.severity, found.objects, found.fix) == ("INFO", ("First", "Second"), "")


def test_too_many_for_the_lightmap_are_named():
    import bpy

    bpy.context.scene.hemibake.resolution = 8
    for number in range(40):
        square(f"Square {number:02d}", WHOLE)
    found = finding("No space")
    assert found.severity == "ERROR" and len(found.objects) == 40
    assert found.fix == "resolution" and f"Use {found.value} texels" in found.text
    bpy.context.scene.hemibake.resolution = found.value
    assert finding("No space") is None


def strips(name, count):
    """Return a square of `count` strips; each is a chart that fills 0.8 of a column of the lightmap."""
    left = np.arange(count) / count
    points = [(x + dx / count, y, 0) for x in left for dx, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    uvs = [(x + dx / count, y) for x in left for dx, y in ((0.1, 0), (0.9, 0), (0.9, 1), (0.1, 1))]
    return mesh_object(name, points, np.arange(4 * count).reshape(-1, 4).tolist(), uvs)


@pytest.mark.parametrize(("count", "fitting"), [(20, None), (40, 64), (211, 512)])
def test_lightmap_that_is_too_small_for_the_charts_is_enlarged(count, fitting):
    import bpy

    strips("Blinds", count)
    found = finding("too small")
    if fitting is None:
        assert found is None
        return
    assert (found.severity, found.objects, found.value) == ("WARNING", ("Blinds",), fitting)
    assert fix(found) == {"FINISHED"} and bpy.context.scene.hemibake.resolution == fitting
    assert finding("too small") is None


def test_width_of_charts():
    """The mean width of a square chart of n x n faces is half its side for any n."""
    import bpy

    uvs = part("operators.check.uvs")
    meshes = part("operators.check.meshes")
    context = part("operators.scene").SceneContext(bpy.context)

    def width(obj):
        (charts,) = finished(uvs.find_charts(finished(meshes.read_meshes(context, [obj])), 32))
        return finished(uvs.chart_width(charts))

    bpy.ops.mesh.primitive_grid_add(x_subdivisions=7, y_subdivisions=13)
    grid = bpy.context.object
    grid.data.uv_layers[0].name = "Lightmap"
    assert width(grid) == pytest.approx(0.5, rel=1e-4)
    assert width(strips("Apart", 10)) == pytest.approx(0.08 / 1.08, rel=1e-3)


def test_modifiers_that_copy_faces_are_told():
    obj = square("Row", [(0.1, 0.1), (0.2, 0.1), (0.2, 0.2), (0.1, 0.2)])
    obj.modifiers.new("Array", "ARRAY")
    found = finding("Modifiers copy")
    assert (found.severity, found.objects) == ("INFO", ("Row",))
    assert fix(found) == {"FINISHED"} and finding("Modifiers copy") is None
    assert [modifier.name for modifier in obj.modifiers] == ["Array", "Lightmap UVs"]


def test_faces_that_look_inwards_are_turned():
    obj = mesh_object("Crate", CUBE, INWARD, np.zeros((24, 2)))
    obj.scale.x = -1
    mesh_object("Box", CUBE, OUTWARD, np.zeros((24, 2)))
    found = finding("point inward, and nothing is inside")
    assert (found.severity, found.objects) == ("WARNING", ("Crate",))
    assert fix(found) == {"FINISHED"}
    normal, centre = obj.data.polygons[0].normal, obj.data.polygons[0].center
    assert normal.dot(centre) > 0 or normal.z < 0
    assert finding("point inward") is None and loop_uvs(obj).shape == (24, 2)


def test_mirrored_object_is_in_order_and_lit_where_blender_shows_its_front():
    import bpy

    square("Floor", WHOLE).scale.x = -1
    crate = mesh_object("Crate", CUBE, OUTWARD)
    crate.location, crate.scale.z = (5, 0, 0), -1
    assert [one.severity for one in check().findings] == ["INFO"]
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    floor = bpy.data.objects["Floor"]
    assert floor.hemibake.image != crate.hemibake.image
    assert pixels(floor.hemibake.image)[..., :3].min() > 0


def test_only_what_is_to_be_baked_needs_lightmap_uvs_and_counts():
    import bpy

    square("Selected", np.array(SQUARE_UVS) / 2)
    square("Other", np.array(SQUARE_UVS) / 2 + 0.5).select_set(False)
    square("New", uvs=None)
    square("Folded", FOLDED).hemibake.atlas = "Folded"
    both = check().estimate.patches
    bpy.context.scene.hemibake.target = "SELECTED"
    assert finding("No selected object").severity == "ERROR"
    bpy.data.objects["Selected"].select_set(True)
    checked = check()
    assert checked.findings == ()
    assert checked.estimate.patches == pytest.approx(0.16 * 32**2, rel=0.1) and both > 2 * 0.16 * 32**2


def test_linked_objects_that_get_no_lightmap_do_not_count(tmp_path):
    import bpy

    library = str(tmp_path / "library.blend")
    there = square("Linked", uvs=None)
    bpy.data.libraries.write(library, {there})
    bpy.data.objects.remove(there)
    with bpy.data.libraries.load(library, link=True) as (_, linked):
        linked.objects = ["Linked"]
    bpy.context.scene.collection.objects.link(linked.objects[0])
    square("Own")
    checked = check()
    assert [one.objects for one in checked.findings] == [("Linked",)]
    assert "'Linked'. Unwrap in that file, override," in checked.findings[0].text
    assert checked.estimate.patches == pytest.approx(0.64 * 32**2, rel=0.1)


def test_blocking_bake_is_checked_before_it_begins():
    import bpy

    square("Folded", FOLDED)
    square("Square").hemibake.atlas = "Other"
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    kept = part("operators.checks").last_check(bpy.context.scene)
    assert [one.objects for one in kept.findings] == [("Folded",)] and kept.estimate.patches > 0


def test_some_faces_turned():
    mesh_object("Crate", CUBE, [*OUTWARD[:5], INWARD[5]], np.zeros((24, 2)))
    found = finding("partly outward")
    assert found.objects == ("Crate",)
    fix(found)
    assert finding("point inward") is None


@pytest.mark.parametrize("thing", ["LIGHT", "MESH"])
def test_rooms_look_inwards(light, thing):
    room = furnace("Room")
    if thing == "LIGHT":
        light.location = (0.5, 0.5, 0.5)
    else:
        square("Table").location = (0, 0, 0.5)
    assert finding("point inward") is None
    room.location.x = 10
    assert finding("point inward").objects == ("Room",)


def test_backface_culling_is_no_finding():
    import bpy

    surface = material("Leaf")
    mesh_object("Canopy", CUBE, OUTWARD[:3], np.zeros((12, 2)), surface=surface)
    mesh_object("Card", CUBE, OUTWARD[4:5], np.zeros((4, 2)), surface=surface)
    before = check()
    surface.use_backface_culling = True
    bpy.context.view_layer.update()
    assert check() == before


def test_open_meshes_and_planes_may_look_anywhere():
    mesh_object("Bowl", CUBE, INWARD[:5], np.zeros((20, 2)))
    assert finding("inward") is None


def test_dim_worlds_are_told_if_they_are_the_only_light(light):
    light.data.energy = 0
    lit = square(surface=material())
    set_world((0.05, 0.04, 0.03))
    assert finding("dim background").severity == "INFO"
    set_world((0.05, 0.04, 0.2))
    assert finding("dim background") is None
    set_world((0.05, 0.04, 0.03))
    lit.data.materials[0] = material("Glow", emission=1)
    assert finding("dim background") is None


def test_only_meshes_without_any_area_are_reported():
    sliver = [(2, 0, 0), (3, 0, 0), (4, 0, 0)]
    mesh_object("Sliver", SQUARE + sliver, [(0, 1, 2, 3), (4, 5, 6)], [*SQUARE_UVS, *[(0, 0)] * 3])
    mesh_object("Line", sliver, [(0, 1, 2)], [(0, 0)] * 3)
    assert finding("zero area").objects == ("Line",)


@pytest.mark.parametrize(("scale", "shrunk"), [((0, 0, 0), True), ((2, 0, 0), True), ((1, 1, 0), False)])
def test_objects_that_are_scaled_to_nothing_are_told(scale, shrunk):
    """Scale 0 along its normal does not change the area of a flat square."""
    import bpy

    square("Even")
    square("Scaled").scale = scale
    found = [each.objects for each in check().findings if "Scale is 0" in each.text]
    assert found == ([("Scaled",)] if shrunk else [])
    bpy.ops.hemibake.bake()
    warnings = report()["warnings"]
    assert any("Scale is 0" in warning for warning in warnings) == shrunk
    assert not any("too small to cover a texel" in warning for warning in warnings)


def test_objects_hidden_from_one_of_viewport_and_renders_are_told():
    square("Shown")
    square("Only shown", np.array(SQUARE_UVS)).hide_render = True
    square("Only rendered").hide_viewport = True
    square("By eye").hide_set(True)
    both = square("Hidden")
    both.hide_viewport = both.hide_render = True
    ignored = square("Ignored")
    ignored.hide_render, ignored.hemibake.role = True, "IGNORED"
    assert finding("hidden in renders, so not baked").objects == ("Only shown",)
    hidden = finding("Hidden in the viewport")
    assert (hidden.severity, hidden.objects) == ("INFO", ("By eye", "Only rendered"))


def test_objects_with_other_geometry_in_renders_are_told():
    import bpy

    square("Same").modifiers.new("Subdivision", "SUBSURF").render_levels = 1
    square("Finer").modifiers.new("Subdivision", "SUBSURF").render_levels = 2
    told = finding("Modifiers or particles differ")
    assert (told.severity, told.objects) == ("INFO", ("Finer",))
    bpy.context.scene.hemibake.meshes = "VIEWPORT"
    told = finding("Modifiers or particles differ")
    assert (told.severity, told.objects) == ("WARNING", ("Finer",))


def test_bakes_without_a_window_print_what_the_check_finds(capfd):
    import bpy

    square("Floor", surface=material("Glow", emission=1.0))
    square("Cutter").hide_render = True
    bpy.ops.hemibake.bake()
    assert "Check: Visible in the viewport but hidden in renders, so not baked: 'Cutter'" in "".join(
        capfd.readouterr()
    )


def image_material(name, path):
    import bpy

    surface = material(name)
    node = surface.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.new(name, 4, 4)
    node.image.filepath_raw, node.image.file_format = str(path), "PNG"
    node.image.save()
    node.image.source = "FILE"
    surface.node_tree.links.new(node.outputs[0], surface.node_tree.nodes["Principled BSDF"].inputs[0])
    return surface


def test_missing_images_are_told(tmp_path):
    there, gone = (image_material(name, tmp_path / f"{name}.png") for name in ("There", "Gone"))
    square("First", surface=there)
    second = square("Second", np.array(SQUARE_UVS) * 0.1, surface=gone)
    assert finding("is missing") is None
    (tmp_path / "Gone.png").unlink()
    found = finding("is missing")
    assert "'Gone'" in found.text and found.objects == (second.name,)
    second.material_slots[0].material.node_tree.nodes["Image Texture"].image.source = "GENERATED"
    assert finding("is missing") is None


def set_world(colour):
    import bpy

    world = bpy.context.scene.world = bpy.data.worlds.new("Sky")
    nodes = part("operators.compat").new_node_tree(world).nodes
    next(node for node in nodes if node.type == "BACKGROUND").inputs["Color"].default_value = (*colour, 1)


def test_darkness_is_told(light):
    lit = square("Square", surface=material())
    assert finding("emits light") is None
    light.data.energy = 0
    assert finding("emits light").severity == "ERROR"
    set_world((0, 0, 0))
    assert finding("emits light")
    set_world((0, 0, 1))
    assert finding("emits light") is None
    set_world((0, 0, 0))
    lit.data.materials[0] = material("Glow", emission=2)
    assert finding("emits light") is None


def test_memory_that_is_not_enough_is_told():
    import bpy

    square()
    machine = part("operators.preferences").machine_properties()
    machine.memory_budget = 1
    try:
        assert finding("Visibility data needs") is None
        bpy.context.scene.hemibake.resolution = 256
        assert finding("Visibility data needs").severity == "WARNING"
    finally:
        machine.property_unset("memory_budget")


@pytest.mark.parametrize("count", [1, 7])
def test_a_fix_that_needs_more_memory_than_is_allowed_says_so(count):
    """The panel shows the first line; names of more than five objects follow in a second one."""
    import bpy

    for number in range(count):
        strips(f"Strips {number}", 60)
    bpy.context.scene.hemibake.resolution = 32
    told = finding("Use ")
    assert told.fix == "resolution" and "Visibility data" not in told.text
    machine = part("operators.preferences").machine_properties()
    machine.memory_budget = 1
    try:
        told = finding("Use ")
        line, newline, names = told.text.partition("\n")
        assert f"At a width of {told.value} texels: Visibility data needs" in line and told.value > 32
        assert (newline + names).startswith("\nAll 7: ") == (count == 7)
    finally:
        machine.property_unset("memory_budget")


def test_modifiers_that_copy_useless_uvs_are_told_as_overlaps():
    """A bake adds its modifier only where the mesh itself has usable UVs."""
    import bpy

    obj = square("Folded twice", FOLDED)
    obj.modifiers.new("Row", "ARRAY").count = 3
    bpy.context.view_layer.update()
    found = finding("would get no lightmap")
    assert (found.severity, found.objects, found.fix) == ("ERROR", ("Folded twice",), "unwrap_again")
    assert finding("a last modifier") is None and finding("moves them apart") is None
    fix(found)
    assert finding("would get no lightmap") is None
    bpy.ops.hemibake.bake()
    assert not any("overlapping" in warning for warning in report()["warnings"])


def test_earlier_bakes_make_the_estimate_a_measured_one():
    import bpy

    furnace()
    bpy.context.scene.hemibake.resolution = 128
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    told = check().estimate
    assert told.measured and told.patches == pytest.approx(report()["patches"], rel=0.05)


def test_fix_that_cannot_be_done_changes_nothing():
    obj = square("Folded", FOLDED)
    for number in range(7):
        obj.data.uv_layers.new(name=f"Layer {number}")
    found, before = finding("Lightmap UVs overlap:"), snapshot()
    with pytest.raises(RuntimeError, match="8 UV layers"):
        fix(found)
    assert snapshot() == before and obj.hemibake.own_uv_layer == ""


def test_panel_shows_findings_with_their_buttons_and_the_estimate():
    from tests.blender.test_panels import draw

    assert draw("HEMIBAKE_PT_check") == ["hemibake.check"]
    square("Folded", FOLDED)
    check()
    shown = draw("HEMIBAKE_PT_check")
    assert shown.count("hemibake.select_objects") == shown.count("hemibake.fix") == 1
    told = " ".join(shown)
    assert "'Folded'" in told and "texels" in told and "on a CPU" in told


def test_bake_in_a_window_checks_the_scene_while_the_worker_works():
    import bpy

    furnace()
    square("Folded", FOLDED).location.x = 5

    # So many rays that they take time: what is done at once has no pace.
    bpy.context.scene.hemibake.samples = 2048
    worker = part("operators.worker_manager").owner.worker()
    run = part("operators.bake_run").BakeRun(bpy.context, worker.bake)
    run.finish(run.run_to_end())
    kept = part("operators.checks").last_check(bpy.context.scene).findings
    assert [one.objects for one in kept if one.severity == "ERROR"] == [("Folded",)]
    assert "Visibility" in " ".join(part("operators.worker_manager").owner.paces)


def test_nasty_scenes_are_checked():
    """NaN and infinite coordinates, flat and huge objects, edit mode, instances, meshes without faces."""
    import bpy

    mesh_object("NaN", [(0, 0, 0), (1, 0, 0), (np.nan, 1, 0)], [(0, 1, 2)], SQUARE_UVS[:3])
    square("Huge").scale = (1e30, 1e30, 1e30)
    square("Infinite", WHOLE).location.x = np.inf
    square("Flat", WHOLE).scale = (0, 0, 0)
    square("Mirrored", WHOLE).scale = (-1, 1, 1)
    square("Point", [(0.5, 0.5)] * 4)
    mesh_object("Edges", SQUARE, [])
    mesh_object("Empty", [], [])
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Axes", None))
    chairs = bpy.data.collections.new("Chairs")
    chair = square("Chair", WHOLE)
    bpy.context.scene.collection.objects.unlink(chair)
    chairs.objects.link(chair)
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", chairs
    bpy.context.scene.collection.objects.link(instance)
    bpy.context.view_layer.objects.active = edited = square("Edited", WHOLE)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.primitive_cube_add()
    checked = check()
    assert bpy.context.mode == "EDIT_MESH" and edited.data.is_editmode
    broken = {name for one in checked.findings if one.severity == "ERROR" for name in one.objects}
    assert {"NaN", "Huge", "Infinite"} <= broken and not {"Flat", "Mirrored", "Chair", "Point"} & broken
    faceless = {one.objects for one in checked.findings if one.text.startswith("No faces")}
    assert faceless == {("Edges", "Empty")}
    assert checked.estimate.patches > 0


def test_check_in_slices_ends_with_its_scene():
    import bpy

    for number in range(5):
        square(f"Square {number}", WHOLE)
    context = part("operators.scene").SceneContext(bpy.context)
    idle = part("operators.checks").IdleCheck(context)
    bpy.context.window.scene = bpy.data.scenes.new("Other")
    bpy.data.scenes.remove(bpy.data.scenes["Scene"])
    for _ in range(100):
        idle.step()
    assert bpy.context.scene.hemibake.findings == ""


def test_charts_that_were_moved_since_they_were_baked_are_told():
    """A bake that includes the object does not report it, nor objects that were never baked."""
    import bpy

    room, other, new = furnace(), square("Other"), square("New")
    other.location, new.hemibake.role = (5, 0, 0), "NO_LIGHTMAP"
    bpy.ops.hemibake.bake()
    assert finding("changed since the bake") is None
    uvs = loop_uvs(room)
    shrink_charts(room)
    shrink_charts(new)
    found = finding("changed since the bake")
    assert found.objects == ("Furnace",) and found.severity == "WARNING"
    bpy.ops.hemibake.bake()
    kept = part("operators.checks").last_check(bpy.context.scene).findings
    assert not any("changed since the bake" in one.text for one in kept)
    assert finding("changed since the bake") is None
    room.hemibake.baked_uvs = ""
    room.data.uv_layers["Lightmap"].uv.foreach_set("vector", uvs.reshape(-1))
    assert finding("changed since the bake") is None


def test_a_bake_of_other_objects_mends_no_moved_charts():
    import bpy

    first, second = furnace(), square("Second")
    second.location, second.hemibake.atlas = (5, 0, 0), "Own"
    bpy.ops.hemibake.bake()
    shrink_charts(second)
    first.select_set(True)
    second.select_set(False)
    bpy.context.view_layer.objects.active = first
    bpy.context.scene.hemibake.target = "SELECTED"
    bpy.ops.hemibake.bake()
    kept = part("operators.checks").last_check(bpy.context.scene).findings
    assert [one.objects for one in kept if "changed since the bake" in one.text] == [("Second",)]


def test_moved_charts_of_what_only_instances_show_are_told():
    import bpy

    bpy.context.scene.hemibake.resolution = 257
    furnace()
    chair, chairs = square("Chair"), bpy.data.collections.new("Chairs")
    bpy.context.scene.collection.objects.unlink(chair)
    chairs.objects.link(chair)
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", chairs
    instance.location, instance.scale = (0.2, 0.2, 0.3), (0.3, 0.3, 0.3)
    bpy.context.scene.collection.objects.link(instance)
    bpy.ops.hemibake.bake()
    assert finding("changed since the bake") is None
    shrink_charts(chair)
    assert finding("changed since the bake").objects == ("Chair",)


def test_instances_of_an_objects_own_geometry_have_charts_of_their_own():
    """Geometry Nodes display a part of a mesh as an instance, whose UVs are not the object's."""
    import bpy

    bpy.context.scene.hemibake.resolution = 257
    corners = [(x + shift, y, 0) for shift in (0, 2) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    uvs = [(x / 2.2 + shift, y / 2.2) for shift in (0, 0.5) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    glow = material("Glow", emission=1.0)
    own = mesh_object("Own", corners, [(0, 1, 2, 3), (4, 5, 6, 7)], uvs, surface=glow)
    kinds = (
        "GeometryNodeSeparateGeometry", "GeometryNodeGeometryToInstance", "GeometryNodeJoinGeometry",
        "GeometryNodeInputIndex",
    )  # fmt: skip
    tree, (start, end, parted, instance, join, index) = geometry_nodes(own, *kinds)
    parted.domain = "FACE"

    # The index of a face as Boolean: the second one becomes an instance.
    pairs = (
        (start.outputs[0], parted.inputs["Geometry"]), (index.outputs[0], parted.inputs["Selection"]),
        (parted.outputs["Selection"], instance.inputs[0]), (instance.outputs[0], join.inputs[0]),
        (parted.outputs["Inverted"], join.inputs[0]), (join.outputs[0], end.inputs[0]),
    )  # fmt: skip
    for one, other in pairs:
        tree.links.new(one, other)
    bpy.context.view_layer.update()
    bpy.ops.hemibake.bake()
    assert own.hemibake.instances and own.hemibake.image
    assert finding("changed since the bake") is None


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_charts_of_modifiers_and_of_a_mesh_in_edit_mode_are_compared_as_they_were_baked(mode):
    import bpy

    copied, edited = square("Copied"), square("Edited")
    edited.location.z = 2
    copied.modifiers.new("Array", "ARRAY").count = 3
    bpy.context.view_layer.objects.active = edited
    bpy.ops.object.mode_set(mode=mode)
    bpy.ops.hemibake.bake()
    assert finding("changed since the bake") is None
    bpy.ops.object.mode_set(mode="OBJECT")
    assert finding("changed since the bake") is None
    copied.modifiers["Array"].count = 2
    bpy.ops.hemibake.unwrap()
    assert finding("changed since the bake").objects == ("Copied",)


def test_instances_within_an_instance_move_no_charts_of_its_object():
    """Geometry Nodes show a finer mesh above it, as an instance in the instance of a collection."""
    import bpy

    bpy.context.scene.hemibake.resolution = 67
    chair = square("Chair", surface=material("Glow", emission=1.0))
    chairs = bpy.data.collections.new("Chairs")
    bpy.context.scene.collection.objects.unlink(chair)
    chairs.objects.link(chair)
    kinds = (
        "GeometryNodeSubdivideMesh", "GeometryNodeTransform", "GeometryNodeGeometryToInstance",
        "GeometryNodeJoinGeometry",
    )  # fmt: skip
    tree, (start, end, finer, raised, instance, join) = geometry_nodes(chair, *kinds)
    raised.inputs["Translation"].default_value = (0, 0, 1)
    pairs = (
        (start, finer), (finer, raised), (raised, instance), (instance, join), (start, join), (join, end),
    )  # fmt: skip
    for one, other in pairs:
        tree.links.new(one.outputs[0], other.inputs[0])
    shown = bpy.data.objects.new("Instance", None)
    shown.instance_type, shown.instance_collection = "COLLECTION", chairs
    bpy.context.scene.collection.objects.link(shown)
    bpy.context.view_layer.update()
    bpy.ops.hemibake.bake()
    assert len(json.loads(shown.hemibake.instances)) == 2
    assert finding("changed since the bake") is None


def test_a_mode_that_leaves_modifiers_out_moves_no_charts():
    import bpy

    obj = square("Bent")
    obj.modifiers.new("Subdivision", "SUBSURF").show_in_editmode = False
    bpy.ops.hemibake.bake()
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    assert finding("changed since the bake") is None
    bpy.ops.object.mode_set(mode="OBJECT")
    assert finding("changed since the bake") is None
    shrink_charts(obj)
    assert finding("changed since the bake").objects == ("Bent",)


def test_a_cancelled_bake_mends_no_moved_charts():
    import bpy

    obj = furnace()
    bpy.ops.hemibake.bake()
    shrink_charts(obj)
    run = part("operators.bake_run").BakeRun(
        bpy.context, part("operators.worker_manager").owner.bake(), watched=False
    )
    while run._check is None or run._check.step():
        run.step()
    run.cancel()
    kept = part("operators.checks").last_check(bpy.context.scene).findings
    assert [one.objects for one in kept if "changed since the bake" in one.text] == [("Furnace",)]


@pytest.mark.parametrize(
    ("size", "text"),
    [(0, "0 MiB"), ((1 << 30) - 1, "1,024 MiB"), (1 << 30, "1.0 GiB"), (37 << 30, "37.0 GiB")],
)
def test_memory_is_told_in_a_unit_that_people_count_it_in(size, text):
    from engine.plan.estimate import Estimate

    told = part("panels.check").estimate_text(Estimate(5, size, 200.0, True))
    assert told == f"5 texels, up to {text} of visibility data, about 3 min on this device"


def _living_room(light):
    """Make a closed room with its faces inwards around a lamp, and a table, as in a render of a room."""
    room = mesh_object("Room", CUBE, INWARD)
    room.scale = (4, 5, 3)
    light.location = (2, 2, 2.5)
    table = mesh_object("Table", CUBE, OUTWARD)
    table.location = (1, 1, 0.01)
    return ("Room", "Table")


def _house(light):
    """Make a closed body whose faces are two meshes, one for each material, as glTF stores it."""
    mesh_object("House", CUBE, OUTWARD[:4], surface=material("Wall"))
    mesh_object("House2", CUBE, OUTWARD[4:], surface=material("Roof"))
    return ("House", "House2")


def _mesh_instances(light):
    """Make objects that share a mesh: with a material of its own, with a bevel, with an armature."""
    import bpy

    original = mesh_object("original", CUBE, OUTWARD, surface=material("Common"))
    names = ["original"]
    for place, name in enumerate(("other", "with_object_material", "modifier_1", "skinned_1"), 1):
        obj = bpy.data.objects.new(name, original.data)
        obj.location.x = 2 * place
        bpy.context.scene.collection.objects.link(obj)
        names.append(name)
    bpy.data.objects["with_object_material"].material_slots[0].link = "OBJECT"
    bpy.data.objects["with_object_material"].material_slots[0].material = material("Own")
    bpy.data.objects["modifier_1"].modifiers.new("Bevel", "BEVEL")
    skeleton = bpy.data.objects.new("Skeleton", bpy.data.armatures.new("Skeleton"))
    bpy.context.scene.collection.objects.link(skeleton)
    bpy.data.objects["skinned_1"].modifiers.new("Armature", "ARMATURE").object = skeleton
    return tuple(sorted(names))


@pytest.mark.parametrize("build", [_living_room, _house, _mesh_instances])
def test_usual_scenes_have_no_false_findings(light, build):
    import bpy

    names = build(light)
    bpy.context.view_layer.update()
    (found,) = check().findings
    assert (found.severity, found.objects) == ("INFO", names) and "No lightmap UVs yet" in found.text
    assert fix(found) == {"FINISHED"}
    assert check().findings == ()
