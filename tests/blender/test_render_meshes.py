"""Meshes and objects are those of renders, whatever the viewport shows."""

import numpy as np
import pytest

from tests.blender.things import (
    CUBE,
    INWARD,
    bpy_link,
    cross,
    finished,
    furnace,
    geometry_nodes,
    material,
    mesh_object,
    part,
    read_scene,
    snapshot,
    square,
    unwrap_missing,
)


@pytest.fixture
def settings():
    import bpy

    return bpy.context.scene.hemibake


def context():
    import bpy

    return part("operators.scene").SceneContext(bpy.context)


def uses_render() -> bool:
    return part("operators.scene.objects.render_differences").uses_render(context())


def triangles() -> dict[str, int]:
    """Return the number of triangles of each mesh that is read, by its name."""
    return {mesh.name: len(mesh.positions) for mesh in read_scene().scene.meshes}


def names() -> list[str]:
    return sorted(triangles())


def subdivided(name="Ball", levels=1, render_levels=3, kind="SUBSURF"):
    obj = square(name)
    modifier = obj.modifiers.new("Subdivision", kind)
    modifier.levels, modifier.render_levels = levels, render_levels
    return obj, modifier


def is_viewport(obj):
    """Let Geometry Nodes make a mesh of one triangle less in the viewport: none of a quad."""
    tree, (start, end, asks, switch) = geometry_nodes(obj, "GeometryNodeIsViewport", "GeometryNodeSwitch")
    switch.input_type = "GEOMETRY"
    tree.links.new(asks.outputs[0], switch.inputs["Switch"])
    tree.links.new(start.outputs[0], switch.inputs["False"])
    tree.links.new(switch.outputs[0], end.inputs[0])


def test_levels_of_renders_are_read():
    subdivided()
    assert uses_render() and triangles() == {"Ball": 128}


def test_viewport_meshes_are_read_where_they_are_chosen(settings):
    subdivided()
    settings.meshes = "VIEWPORT"
    assert not uses_render() and triangles() == {"Ball": 8}


def test_viewport_meshes_of_objects_hidden_there_are_those_of_renders(settings):
    subdivided("Shown")
    subdivided("Hidden")[0].hide_viewport = True
    settings.meshes = "VIEWPORT"
    assert triangles() == {"Shown": 8, "Hidden": 128}


def test_modifiers_that_only_renders_show_are_read():
    _, modifier = subdivided(render_levels=1)
    assert not uses_render()
    modifier.show_viewport = False
    assert uses_render() and triangles() == {"Ball": 8}
    modifier.show_viewport, modifier.show_render = True, False
    assert uses_render() and triangles() == {"Ball": 2}


def test_simplify_of_renders_limits_levels():
    import bpy

    subdivided(render_levels=1)
    render = bpy.context.scene.render
    render.use_simplify, render.simplify_subdivision, render.simplify_subdivision_render = True, 0, 3
    assert uses_render() and triangles() == {"Ball": 8}
    render.simplify_subdivision_render = 0
    assert not uses_render() and triangles() == {"Ball": 2}


def test_multires_has_the_levels_of_renders():
    import bpy

    obj = square("Sculpted")
    modifier = obj.modifiers.new("Multires", "MULTIRES")
    bpy.context.view_layer.objects.active = obj
    for _ in range(2):
        bpy.ops.object.multires_subdivide(modifier="Multires", mode="SIMPLE")
    modifier.levels, modifier.render_levels = 0, 2
    assert uses_render() and triangles() == {"Sculpted": 32}


def test_nodes_that_ask_for_the_viewport_are_answered_as_in_renders():
    import bpy

    first = square("First")
    is_viewport(first)
    inner = first.modifiers[0].node_group
    second = square("Second")
    tree, (start, end, group) = geometry_nodes(second, "GeometryNodeGroup")
    group.node_tree = inner
    tree.links.new(start.outputs[0], group.inputs[0])
    tree.links.new(group.outputs[0], end.inputs[0])
    assert triangles() == {"First": 2, "Second": 2}
    bpy.data.objects.remove(first)
    assert uses_render()


def test_objects_hidden_in_the_viewport_are_read():
    import bpy

    square("Shown")
    square("By eye").hide_set(True)
    square("In viewports").hide_viewport = True
    square("In renders").hide_render = True
    for name, setting in (("Unrendered", "hide_render"), ("Unseen", "hide_viewport")):
        collection = bpy.data.collections.new(name)
        bpy.context.scene.collection.children.link(collection)
        inside = square(f"In {name}")
        bpy.context.scene.collection.objects.unlink(inside)
        collection.objects.link(inside)
        setattr(collection, setting, True)
    excluded = bpy.data.collections.new("Excluded")
    bpy.context.scene.collection.children.link(excluded)
    excluded.objects.link(bpy.data.objects.new("In Excluded", bpy.data.objects["Shown"].data.copy()))
    bpy.context.view_layer.layer_collection.children["Excluded"].exclude = True
    ignored = square("Ignored")
    ignored.hemibake.role = "IGNORED"
    assert names() == ["By eye", "In Unseen", "In viewports", "Shown"]
    assert len(read_scene().objects) == 4


def test_lamps_hidden_in_the_viewport_shine():
    import bpy

    square()
    for name, hide in (("Eye", "hide_set"), ("Viewport", "hide_viewport"), ("Render", "hide_render")):
        lamp = bpy_link(bpy.data.objects.new(name, bpy.data.lights.new(name, "POINT")))
        lamp.location = (2, 3, 5)
        lamp.hide_set(True) if hide == "hide_set" else setattr(lamp, hide, True)
    read = read_scene()
    lamps = sorted((light.name, *np.round(light.position + read.scene.origin)) for light in read.scene.lights)
    assert lamps == [("Eye", 2, 3, 5), ("Viewport", 2, 3, 5)]
    again = finished(part("operators.scene").read_lamps(context(), read.scene))
    assert [light.name for light in again.lights] == [light.name for light in read.scene.lights]


def test_instances_are_those_of_renders():
    import bpy

    square("Floor")
    collection = bpy.data.collections.new("Tree")
    for name, setting in (("Trunk", None), ("Leaves", "hide_viewport"), ("Proxy", "hide_render")):
        child = bpy.data.objects.new(name, bpy.data.objects["Floor"].data.copy())
        collection.objects.link(child)
        if setting is not None:
            setattr(child, setting, True)
    empty = bpy_link(bpy.data.objects.new("Empty", None))
    empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", collection, (0, 0, 7)
    bpy.context.view_layer.update()
    meshes = [obj.name for obj in part("operators.scene").visible_meshes(context())]
    assert sorted(meshes) == ["Floor", "Leaves", "Trunk"]
    read = read_scene()
    assert sorted(entry.name for entry in read.instances) == ["Leaves", "Trunk"]
    empty.hide_set(True)
    assert sorted(entry.name for entry in read_scene().instances) == ["Leaves", "Trunk"]
    empty.hide_render = True
    assert read_scene().instances == ()


def test_known_instances_are_forgotten_with_each_change():
    import bpy

    source = square("Source")
    source.hide_set(True)
    group = bpy.data.collections.new("Group")
    group.objects.link(bpy.data.objects.new("First", source.data))
    empty = bpy_link(bpy.data.objects.new("Empty", None))
    empty.instance_type, empty.instance_collection = "COLLECTION", group
    pairs = part("operators.scene.objects.instancing").instance_pairs
    assert len(pairs(context())) == 1
    group.objects.link(bpy.data.objects.new("Second", source.data))
    assert len(pairs(context())) == 2


def test_particles_have_the_amount_of_renders():
    import bpy

    child, ground = square("Child"), square("Ground")
    child.hide_render = True
    child.hide_viewport = True
    ground.modifiers.new("Grass", "PARTICLE_SYSTEM")
    settings = ground.particle_systems[0].settings
    settings.type, settings.count, settings.render_type = "HAIR", 7, "OBJECT"
    settings.instance_object, settings.display_percentage = child, 10
    child.hide_render = False
    bpy.context.view_layer.update()
    read = read_scene()
    assert len(read.instances) == 7 and {entry.name for entry in read.instances} == {"Child"}


def scatter(name, kind, block, separate=False):
    """Let Geometry Nodes show an object or a collection on two points."""
    points = mesh_object(name, [(0, 0, 0), (3, 0, 0)], [])
    tree, (start, end, info, shown) = geometry_nodes(points, kind, "GeometryNodeInstanceOnPoints")
    info.inputs[0].default_value = block
    info.inputs[
        "As Instance" if kind == "GeometryNodeObjectInfo" else "Separate Children"
    ].default_value = separate
    tree.links.new(start.outputs[0], shown.inputs["Points"])
    tree.links.new(info.outputs["Geometry" if "Geometry" in info.outputs else 0], shown.inputs["Instance"])
    tree.links.new(shown.outputs[0], end.inputs[0])
    return points


@pytest.mark.parametrize("meshes", ["RENDER", "VIEWPORT"])
def test_scattered_objects_may_be_hidden_in_renders(settings, meshes):
    """A scatter hides its sources in renders, and the render shows its instances."""
    import bpy

    settings.meshes = meshes
    source, ground = square("Grass"), square("Ground")
    source.hide_render = True
    scatter("By nodes", "GeometryNodeObjectInfo", source, separate=True)
    ground.modifiers.new("Particles", "PARTICLE_SYSTEM")
    particles = ground.particle_systems[0].settings
    particles.type, particles.count, particles.render_type = "HAIR", 3, "OBJECT"
    particles.instance_object, particles.display_method = source, "RENDER"
    particles.display_step = particles.render_step
    bpy.context.view_layer.update()
    assert not uses_render()
    meshes = [obj.name for obj in part("operators.scene").visible_meshes(context())]
    assert sorted(meshes) == ["By nodes", "Grass", "Ground"]
    read = read_scene()
    assert [entry.name for entry in read.instances] == ["Grass"] * 5
    assert len(read.scene.meshes) == 6


@pytest.mark.parametrize("hidden", [False, True])
def test_scattered_texts_are_shown_unless_they_are_hidden_in_renders(hidden):
    """Renders do not evaluate the faces of such texts."""
    import bpy

    square("Ground")
    text = bpy_link(bpy.data.objects.new("Text", bpy.data.curves.new("Text", "FONT")))
    text.data.body, text.hide_render = "O", hidden
    scatter("By nodes", "GeometryNodeObjectInfo", text, separate=True)
    bpy.context.view_layer.update()
    instances = [each for each in read_scene().placed if each.source == text.session_uid]
    assert len(instances) == (0 if hidden else 1 + 2)


@pytest.mark.parametrize(("separate", "shown"), [(False, 2), (True, 4)])
def test_collections_scatter_what_renders_show(separate, shown):
    """A collection as a whole leaves out its members that are hidden in renders; its children do not."""
    import bpy

    collection = bpy.data.collections.new("Tree")
    for name in ("Trunk", "Proxy"):
        collection.objects.link(bpy.data.objects.new(name, square(f"Model of {name}").data))
    collection.objects["Proxy"].hide_render = True
    scatter("Points", "GeometryNodeCollectionInfo", collection, separate)
    bpy.context.view_layer.update()
    assert uses_render()
    assert len(read_scene().instances) == shown


def test_scatters_in_instanced_collections_are_those_of_renders():
    import bpy

    source = square("Grass")
    source.hide_render = True
    points = scatter("Points", "GeometryNodeObjectInfo", source, separate=True)
    meadow = bpy.data.collections.new("Meadow")
    meadow.objects.link(points)
    bpy.context.scene.collection.objects.unlink(points)
    empty = bpy_link(bpy.data.objects.new("Empty", None))
    empty.instance_type, empty.instance_collection = "COLLECTION", meadow
    bpy.context.view_layer.update()
    assert [entry.name for entry in read_scene().instances] == ["Grass"] * 2


@pytest.mark.parametrize("kind", ["VERTS", "FACES"])
def test_children_hidden_in_renders_are_not_shown_on_vertices_or_faces(kind):
    """A node group of the parent makes no instances of them."""
    import bpy

    child, parent = square("Child"), square("Parent")
    child.parent, child.hide_render = parent, True
    parent.instance_type = kind
    tree, (start, end) = geometry_nodes(parent)
    tree.links.new(start.outputs[0], end.inputs[0])
    bpy.context.view_layer.update()
    assert not uses_render()
    assert read_scene().instances == ()
    child.hide_render = False
    assert {entry.name for entry in read_scene().instances} == {"Child"}


def test_lightmap_uvs_in_modifiers_do_not_ask_for_the_graph_of_renders():
    import bpy

    obj, subdivision = row()
    subdivision.levels = subdivision.render_levels
    unwrap_missing([obj], 64, part("operators.rollback").Rollback())
    assert obj.modifiers[-1].type == "NODES"
    scatter("Points", "GeometryNodeObjectInfo", square("Grass"))
    group = bpy.data.collections.new("Group")
    group.objects.link(bpy.data.objects.new("Member", bpy.data.objects["Grass"].data))
    empty = bpy_link(bpy.data.objects.new("Empty", None))
    empty.instance_type, empty.instance_collection = "COLLECTION", group
    bpy.context.view_layer.update()
    assert not uses_render()


def test_an_object_in_edit_mode_is_read_as_it_is_edited():
    import bmesh
    import bpy

    subdivided("Other")
    obj = mesh_object("Edited", CUBE, INWARD)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    edited = bmesh.from_edit_mesh(obj.data)
    bmesh.ops.delete(edited, geom=list(edited.faces)[:2], context="FACES_ONLY")
    bmesh.update_edit_mesh(obj.data)
    assert uses_render() and triangles() == {"Edited": 8, "Other": 128}
    assert bpy.context.mode == "EDIT_MESH"


def test_equal_scenes_are_read_from_the_viewport():
    import bpy

    subdivided(render_levels=1)
    carrier = square("Hidden everywhere")
    carrier.hide_viewport = carrier.hide_render = True
    square("Cutter").hide_render = True
    bpy.context.view_layer.update()
    assert not uses_render()


def test_both_depsgraphs_give_the_same_bits(monkeypatch):
    import bpy

    furnace()
    obj, _ = subdivided(render_levels=1)
    obj.location = (3, -7, 0.3)
    lamp = bpy_link(bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "AREA")))
    lamp.location = (1, 2, 3)
    shown = read_scene()
    monkeypatch.setattr(part("operators.scene.read"), "uses_render", lambda _: True)
    monkeypatch.setattr(part("operators.scene.objects.evaluation"), "uses_render", lambda _: True)
    rendered = read_scene()
    for one, other in zip(shown.scene.meshes, rendered.scene.meshes, strict=True):
        assert one.name == other.name
        for field in ("positions", "normals", "uvs", "face", "subface", "material"):
            left, right = getattr(one, field), getattr(other, field)
            assert (left is None) == (right is None) and (left is None or np.array_equal(left, right))
    assert shown.fingerprints == rendered.fingerprints


def test_nothing_of_the_file_changes():
    import bpy

    obj, _ = subdivided()
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    before = snapshot()
    objects, engine = set(bpy.data.objects), bpy.context.scene.render.engine
    read_scene()
    assert snapshot() == before and set(bpy.data.objects) == objects
    assert bpy.context.scene.render.engine == engine and not hasattr(bpy.types, "HEMIBAKE_READ")


def test_errors_of_the_function_arrive_and_nothing_is_left():
    import bpy

    subdivided()
    before = snapshot()
    evaluate = part("operators.scene.objects.evaluation").evaluate

    def fail(evaluation):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        evaluate(context(), fail)
    assert snapshot() == before and len(bpy.data.objects) == 1
    assert not part("operators.scene.objects.render_depsgraph").reads_render()


def test_updates_of_the_reader_are_no_changes():
    subdivided()
    watch = part("operators.scene.scene_watch").SceneWatch(context())
    with watch:
        for _ in range(3):
            watch.evaluate(lambda evaluation: None)
        watch.depsgraph()


def test_a_scene_that_renders_show_empty_is_told():
    square().hide_render = True
    with pytest.raises(Exception, match="no mesh with faces"):
        read_scene()


def test_uvs_are_made_for_the_faces_of_renders():
    obj = mesh_object("Row", CUBE, INWARD)
    array = obj.modifiers.new("Array", "ARRAY")
    array.count, array.show_viewport = 3, False
    changes = part("operators.rollback").Rollback()
    unwrap_missing([obj], 64, changes)
    read = read_scene()
    assert len(read.objects) == 1 and len(read.scene.meshes[0].uvs) == 36
    assert not read.notes or all("no lightmap" not in note for note in read.notes)
    assert unwrap_missing([obj], 64, changes).objects == []


def row():
    """Return an object that modifiers give other faces in renders: three cubes, subdivided there alone."""
    obj = mesh_object("Row", CUBE, INWARD)
    array = obj.modifiers.new("Array", "ARRAY")
    array.count, array.relative_offset_displace = 3, (1.5, 0, 0)
    subdivision = obj.modifiers.new("Subdivision", "SUBSURF")
    subdivision.subdivision_type, subdivision.levels, subdivision.render_levels = "SIMPLE", 0, 2
    return obj, subdivision


def mesh_uvs(obj, evaluation):
    """Return the triangles of an object's mesh and their lightmap UVs, (t, 3, 3) and (t, 3, 2)."""
    mesh = part("operators.scene.uvs.uv_projection").read_uv_mesh(evaluation.evaluated(obj).data, "Lightmap")
    return mesh.points, None if mesh.uvs is None else mesh.uvs[mesh.triangles]


def test_the_viewport_has_uvs_of_its_own_faces():
    import bpy

    obj, subdivision = row()
    changes = part("operators.rollback").Rollback()
    unwrap_missing([obj], 64, changes)
    evaluation = part("operators.scene.objects.evaluation")
    shown, shown_uvs = mesh_uvs(obj, evaluation.Evaluation(bpy.context.evaluated_depsgraph_get()))
    baked, baked_uvs = evaluation.evaluate(context(), lambda each: mesh_uvs(obj, each))
    assert len(shown) == 36 and len(baked) == 576
    area = lambda uvs: np.abs(cross(uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0])).sum()  # noqa: E731
    assert area(shown_uvs) == pytest.approx(area(baked_uvs), rel=1e-4)
    for point, uv in zip(shown.reshape(-1, 3), shown_uvs.reshape(-1, 2), strict=True):
        same = np.abs(baked - point).max(axis=2) < 1e-5
        assert np.linalg.norm(baked_uvs[same] - uv, axis=1).min() < 1e-5

    # Nothing is made again while nothing changes; equal settings need one set of UVs.
    group = obj.modifiers[-1].node_group
    nodes = len(group.nodes)
    unwrap_missing([obj], 64, changes)
    assert obj.modifiers[-1].node_group == group and len(group.nodes) == nodes
    subdivision.levels = 1
    unwrap_missing([obj], 64, changes)
    assert len(mesh_uvs(obj, evaluation.Evaluation(bpy.context.evaluated_depsgraph_get()))[1]) == 144
    changes.undo()
    assert len(obj.modifiers) == 2 and len(bpy.data.objects) == 1 and not bpy.data.node_groups


def test_uvs_for_the_viewport_go_once_its_faces_are_those_of_renders():
    import bpy

    obj, subdivision = row()
    changes = part("operators.rollback").Rollback()
    unwrap_missing([obj], 64, changes)
    carriers, group = len(bpy.data.objects), obj.modifiers[-1].node_group
    subdivision.levels = 2
    unwrap_missing([obj], 64, changes)
    assert obj.modifiers[-1].node_group == group and len(bpy.data.objects) == carriers - 1
    assert not uses_render()


def test_export_names_objects_whose_light_is_off():
    """Simple subdivision keeps the shape, which UVs of coarse faces follow."""
    import bpy

    proxy = square("Proxy")
    tree, (start, end, move) = geometry_nodes(proxy, "GeometryNodeTransform")
    tree.links.new(start.outputs[0], move.inputs[0])
    tree.links.new(move.outputs[0], end.inputs[0])
    move.inputs["Scale"].default_value = (0.1, 0.1, 0.1)
    proxy.modifiers[0].show_render = False
    objects = [square("Same"), row()[0], proxy]
    unwrap_missing(objects, 47, part("operators.rollback").Rollback())
    for obj in objects:
        obj.hemibake.image, obj.hemibake.uv_layer = bpy.data.images.new("Lightmap", 47, 47), "Lightmap"
    surfaces = part("operators.gltf.export_items").ExportItems(bpy.context).all
    note = part("operators.gltf.mesh_differences").note_other_meshes
    (said,) = note(context(), surfaces, "Lightmap")
    assert "'Proxy'" in said and "'Row'" not in said and "'Same'" not in said
    proxy.modifiers[0].show_viewport = False
    assert note(context(), surfaces, "Lightmap") == []


def test_projection_stays_within_the_chart_of_a_face():
    """Two sides of a thin wall have charts of their own."""
    projection = part("operators.scene.uvs.uv_projection")
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], np.float32)
    back = corners[::-1] - np.float32([0, 0, 0.001])
    uvs = np.float32([(0.1, 0.1), (0.4, 0.1), (0.4, 0.4), (0.1, 0.4)])
    loops = np.arange(8, dtype=np.int32)
    wall = projection.UvMesh(
        np.concatenate([corners, back]), loops, loops[::4],
        np.int32([(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)]), np.int32([0, 0, 1, 1]),
        np.concatenate([uvs, uvs[::-1] + 0.5]),
    )  # fmt: skip
    coarse = projection.UvMesh(
        np.concatenate([corners[:3] * 0.5, back[:3] * 0.5]), loops[:6], loops[:6:3], loops[:6].reshape(2, 3),
        np.int32([0, 1]), None,
    )  # fmt: skip
    got = projection.UvProjection(wall).corner_uvs(coarse)
    np.testing.assert_allclose(got[:3], [(0.1, 0.1), (0.25, 0.1), (0.25, 0.25)], atol=1e-5)
    assert (got[3:] > 0.5).all()
    assert projection.UvProjection(wall).largest_error(wall) < 1e-5


def test_the_viewport_is_read_for_objects_that_depend_on_nothing_that_differs(monkeypatch):
    import bpy

    subdivided("Other")
    plain, cut, hidden = square("Plain"), square("Cut"), square("Hidden")
    plain.modifiers.new("Bevel", "BEVEL")
    cut.modifiers.new("Boolean", "BOOLEAN").object = bpy.data.objects["Other"]
    hidden.hide_set(True)
    evaluation = part("operators.scene.objects.evaluation")
    modes = [
        evaluation.evaluate(context(), lambda each: each.depsgraph.mode, only)
        for only in ([plain], [plain, cut], [hidden], [bpy.data.objects["Other"]], [], None)
    ]
    assert modes == ["VIEWPORT", "RENDER", "RENDER", "RENDER", "VIEWPORT", "RENDER"]


def test_materials_that_cycles_evaluates_are_read_on_meshes_of_renders():
    """Generated coordinates of a square that is twice as wide in renders."""
    surface = material("Stripes")
    tree = surface.node_tree
    coordinates, noise = (tree.nodes.new(f"ShaderNodeTex{kind}") for kind in ("Coord", "Noise"))
    tree.links.new(coordinates.outputs["Object"], noise.inputs["Vector"])
    tree.links.new(noise.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    obj = square("Square", surface=surface)
    nodes, (start, end, move) = geometry_nodes(obj, "GeometryNodeTransform")
    nodes.links.new(start.outputs[0], move.inputs[0])
    nodes.links.new(move.outputs[0], end.inputs[0])
    move.inputs["Scale"].default_value = (9, 9, 9)
    obj.modifiers[0].show_viewport = False
    rendered = read_scene().scene.materials[0].reflectance_map.pixels
    obj.modifiers[0].show_viewport = True
    assert np.array_equal(read_scene().scene.materials[0].reflectance_map.pixels, rendered)
    obj.modifiers[0].show_viewport = obj.modifiers[0].show_render = False
    assert not np.allclose(read_scene().scene.materials[0].reflectance_map.pixels, rendered, atol=0.02)


def test_moved_objects_are_where_a_whole_reading_has_them():
    import bpy

    moved_read = part("operators.scene").read_moved
    first, mirrored, still = subdivided("First")[0], square("Mirrored"), square("Still")
    child = square("Child")
    child.parent, child.location = first, (3, 1, 2)
    still.location = (900, 70, 7)
    before = read_scene()
    first.rotation_euler, first.scale = (0.3, 0.2, 0.1), (1, 2, 0.5)
    mirrored.location, mirrored.scale = (5, 0, 0.1), (-1, 1, 1)
    uids = {obj.session_uid for obj in (first, mirrored, child)}
    bpy.context.view_layer.update()
    moved, whole = moved_read(context(), before, uids), read_scene()
    for one, other in zip(moved.scene.meshes, whole.scene.meshes, strict=True):
        np.testing.assert_allclose(
            one.positions + moved.scene.origin, other.positions + whole.scene.origin, atol=1e-3
        )
        np.testing.assert_allclose(one.normals, other.normals, atol=1e-5)
        assert one.name == other.name
    assert [placed.matrix.tolist() for placed in moved.placed] == [
        placed.matrix.tolist() for placed in whole.placed
    ]
    first.scale.z = 0
    assert moved_read(context(), before, uids) is None
