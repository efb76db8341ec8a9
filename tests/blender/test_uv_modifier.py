"""Lightmap UVs for modifiers that copy or create faces, stored by a last modifier."""

import numpy as np
import pytest

from tests.blender.things import (
    CUBE,
    INWARD,
    SQUARE,
    SQUARE_UVS,
    bpy_link,
    covering,
    evaluated_uvs,
    furnace,
    material,
    mesh_object,
    part,
    pixels,
    read_scene,
    report,
    snapshot,
    square,
)
from tests.rows import long

NAME = "Lightmap UVs"


@pytest.fixture(autouse=True)
def resolution():
    import bpy

    bpy.context.scene.hemibake.resolution = 64


def bake():
    import bpy

    return bpy.ops.hemibake.bake()


def unwrap():
    import bpy

    return bpy.ops.hemibake.unwrap()


def copied(kind="ARRAY", name="Chair", **settings):
    """Return a cube with a modifier."""
    obj = mesh_object(name, CUBE, INWARD, surface=material(name, emission=0.5))
    modifier = obj.modifiers.new("Copier", kind)
    for key, value in settings.items():
        setattr(modifier, key, value)
    return obj


def coverage(*objects, size=256) -> np.ndarray:
    """Return the number of triangles over each texel centre of a grid over the lightmap."""
    meshes = read_scene().scene.meshes
    return covering(np.concatenate([mesh.uvs for mesh in meshes if mesh.name in objects]), size)


@pytest.mark.parametrize(
    "kind", ["ARRAY", "MIRROR", long("SOLIDIFY"), long("SCREW"), long("WIREFRAME"), long("REMESH")]
)
def test_what_a_modifier_makes_is_baked_beside_others(kind):
    import bpy

    chair, other = copied(kind), mesh_object("Other", CUBE, INWARD)
    other.location.x = 9
    assert bake() == {"FINISHED"}
    assert [modifier.name for modifier in chair.modifiers] == ["Copier", NAME]
    assert not chair.data.uv_layers and [layer.name for layer in other.data.uv_layers] == ["Lightmap"]
    assert chair.hemibake.image == other.hemibake.image == bpy.data.images["Lightmap"]
    assert report()["objects"] == 2
    assert any("'Chair'" in warning and NAME in warning for warning in report()["warnings"])
    covered = coverage("Chair", "Other")
    assert (covered > 1).sum() <= 0.005 * (covered > 0).sum()


def test_active_modifier_stays_active():
    chair = copied()
    bake()
    assert len(chair.modifiers) == 2 and chair.modifiers.active == chair.modifiers["Copier"]


def test_second_bake_keeps_the_uvs_and_says_nothing():
    chair = copied()
    bake()
    before = evaluated_uvs(chair)
    bake()
    assert (evaluated_uvs(chair) == before).all()
    assert not any(NAME in warning for warning in report()["warnings"])


def test_copies_in_light_and_shadow_differ():
    """Two squares of an array, one of them under a roof."""
    import bpy

    chair = mesh_object("Floor", SQUARE, [(0, 1, 2, 3)])
    chair.modifiers.new("Array", "ARRAY").relative_offset_displace = (3, 0, 0)
    roof = square("Roof", uvs=None)
    roof.location, roof.hemibake.role = (0, 0, 0.05), "NO_LIGHTMAP"
    world = bpy.context.scene.world = bpy.data.worlds.new("Sky")
    nodes = part("operators.compat").new_node_tree(world).nodes
    next(node for node in nodes if node.type == "BACKGROUND").inputs["Color"].default_value = (1, 1, 1, 1)
    bake()
    image = pixels(chair.hemibake.image)[..., 0]
    means = []
    for uvs in evaluated_uvs(chair).reshape(2, 4, 2):
        column, row = (uvs.mean(axis=0) * 64).astype(int)
        means.append(image[row - 3 : row + 4, column - 3 : column + 4].mean())
    assert means[0] < 0.2 and means[1] == pytest.approx(1, rel=0.02)


def test_render_of_the_preview_shows_the_light_of_each_copy(tmp_path):
    import bpy

    test_copies_in_light_and_shadow_differ()
    assert bpy.ops.hemibake.preview() == {"FINISHED"}
    scene = bpy.context.scene
    bpy.data.objects["Roof"].hide_render, scene.world = True, None
    camera = bpy_link(bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera")))
    camera.data.type, camera.data.ortho_scale, camera.location = "ORTHO", 8, (2, 0.5, 3)
    scene.camera, scene.render.engine, scene.cycles.samples = camera, "CYCLES", 16
    scene.render.resolution_x, scene.render.resolution_y, scene.view_settings.view_transform = 64, 16, "Raw"
    scene.cycles.use_denoising = False
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.filepath = str(tmp_path / "shown.exr")
    bpy.ops.render.render(write_still=True)
    shown = pixels(bpy.data.images.load(scene.render.filepath))[..., 0]
    dark, lit = shown[6:10, 18:22].mean(), shown[6:10, 42:46].mean()
    assert dark < 0.2 * 0.8 and lit == pytest.approx(0.8, rel=0.03)


def test_changed_modifiers_are_noticed():
    import bpy

    chair = copied(count=2)
    bake()
    chair.modifiers["Copier"].count = 5
    bake()
    assert len(evaluated_uvs(chair)) == 5 * 24 and coverage("Chair").max() == 1
    assert [modifier.name for modifier in chair.modifiers] == ["Copier", NAME]
    chair.modifiers.remove(chair.modifiers["Copier"])
    bake()
    assert not chair.modifiers and "Lightmap" in chair.data.uv_layers
    bake()
    assert not [group for group in bpy.data.node_groups if group.name.startswith(".")]
    assert not [obj for obj in bpy.data.objects if obj.name.startswith(".")]


def test_modifier_added_later_comes_before_and_is_noticed():
    chair = copied()
    bake()
    chair.modifiers.new("Bevel", "BEVEL")
    assert [modifier.name for modifier in chair.modifiers] == ["Copier", "Bevel", NAME]
    bake()
    assert coverage("Chair").max() == 1


def test_modifier_that_the_user_has_pinned_comes_before():
    chair = copied()
    chair.modifiers.new("Pinned", "SOLIDIFY").use_pin_to_last = True
    unwrap()
    assert [modifier.name for modifier in chair.modifiers] == ["Copier", "Pinned", NAME]
    before = evaluated_uvs(chair)
    assert coverage("Chair").max() == 1
    unwrap()
    assert (evaluated_uvs(chair) == before).all()
    chair.modifiers.new("Late", "BEVEL").use_pin_to_last = True
    unwrap()
    assert len(chair.modifiers) == 4 and chair.modifiers[-1].name == NAME
    assert coverage("Chair").max() == 1


def test_modifier_that_does_not_come_last_is_made_anew():
    chair = copied()
    unwrap()
    chair.modifiers[NAME].use_pin_to_last = False
    chair.modifiers.move(1, 0)
    unwrap()
    assert [modifier.name for modifier in chair.modifiers] == ["Copier", NAME]
    assert coverage("Chair").max() == 1


@pytest.mark.parametrize("shown", ["show_viewport", "show_render"])
def test_modifier_that_is_switched_off_is_made_anew(shown):
    chair = copied()
    unwrap()
    setattr(chair.modifiers[NAME], shown, False)
    unwrap()
    assert [modifier.name for modifier in chair.modifiers] == ["Copier", NAME]
    assert getattr(chair.modifiers[NAME], shown) and coverage("Chair").max() == 1


def test_mesh_of_another_size_keeps_its_uvs():
    """Until the next bake UVs meant for other corners are not shown."""
    import bpy

    chair = square("Chair")
    array = chair.modifiers.new("Array", "ARRAY")
    bake()
    array.count = 3
    bpy.context.view_layer.update()
    assert (evaluated_uvs(chair).reshape(3, 4, 2) == np.float32(SQUARE_UVS)).all()
    assert len(chair.data.uv_layers) == 1


@pytest.mark.parametrize("again", [False, True])
@pytest.mark.parametrize("how", ["cancel", "error"])
def test_bake_that_ends_early_leaves_everything_as_before(how, again):
    import bpy

    chair = copied()
    if again:
        bake()
        chair.modifiers["Copier"].count = 3
    before = snapshot()
    uvs = evaluated_uvs(chair) if again else None
    if how == "cancel":
        run = part("operators.bake_run").BakeRun(bpy.context, part("engine").bake)
        run.run_to_end()
        run.cancel()
    else:
        bpy.context.scene.hemibake.directory = ""
        with pytest.raises(RuntimeError, match="Choose one"):
            bake()
    assert snapshot() == before
    if again:
        assert (evaluated_uvs(chair) == uvs).all()


def test_uvs_survive_saving_and_the_preview_shows_them(tmp_path):
    import bpy

    chair = copied()
    bake()
    before = evaluated_uvs(chair)
    path = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    chair = bpy.data.objects["Chair"]
    assert (evaluated_uvs(chair) == before).all()
    assert bpy.ops.hemibake.preview() == {"FINISHED"}
    nodes = chair.material_slots[0].material.node_tree.nodes
    (uv,) = [node for node in nodes if node.type == "UVMAP"]
    assert uv.uv_map == chair.hemibake.uv_layer == "Lightmap"
    assert (evaluated_uvs(chair, uv.uv_map) == before).all()


def test_layer_of_the_user_stays_as_it_is():
    chair = square("Chair")
    chair.modifiers.new("Array", "ARRAY")
    bake()
    uvs = np.empty(8, np.float32)
    chair.data.uv_layers["Lightmap"].uv.foreach_get("vector", uvs)
    assert (uvs.reshape(4, 2) == np.float32(SQUARE_UVS)).all()
    assert coverage("Chair").max() == 1


def test_users_of_one_mesh_with_modifiers_of_their_own():
    """The plain one keeps the mesh's layer, equal ones have the same UVs, all have a place of their own."""
    import bpy

    plain = mesh_object("Plain", CUBE, INWARD)
    for number, count in enumerate((2, 2, 3), 1):
        obj = bpy_link(bpy.data.objects.new(f"Row {number}", plain.data))
        obj.location.y = 3 * number
        obj.modifiers.new("Array", "ARRAY").count = count
    names = ("Plain", "Row 1", "Row 2", "Row 3")
    assert bake() == {"FINISHED"}
    rows = [bpy.data.objects[name] for name in names[1:]]
    groups = [row.modifiers[NAME].node_group for row in rows]
    assert groups[0] == groups[1] != groups[2] and not plain.modifiers
    assert "Lightmap" in plain.data.uv_layers and report()["objects"] == 4
    for atlas in {obj.hemibake.image for obj in (plain, *rows)}:
        assert coverage(*[obj.name for obj in (plain, *rows) if obj.hemibake.image == atlas]).max() == 1


def test_instances_of_an_object_with_modifiers():
    import bpy

    chairs = bpy.data.collections.new("Chairs")
    chair = copied()
    bpy.context.scene.collection.objects.unlink(chair)
    chairs.objects.link(chair)
    for number in range(2):
        empty = bpy_link(bpy.data.objects.new(f"Instance {number}", None))
        empty.instance_type, empty.instance_collection, empty.location.y = "COLLECTION", chairs, 3 * number
    assert bake() == {"FINISHED"}
    assert report()["instances"] == 2 and coverage("Chair").max() == 1


def test_each_material_slot_stays_on_its_faces_of_each_copy():
    """An odd number of mirrored copies, of which one face each glows, in an object of negative scale."""
    import bpy

    chair = copied(count=3)
    chair.data.materials.append(material("Glow", emission=7.0))
    chair.data.polygons[4].material_index = 1
    chair.scale = (-1, 0.3, 2)
    mirror = chair.modifiers.new("Mirror", "MIRROR")
    mirror.use_axis, mirror.use_mirror_merge = (False, True, False), False
    other = mesh_object("Other", CUBE, INWARD)
    other.location.x = 9
    bpy.context.view_layer.update()
    unwrap()
    scene = read_scene().scene
    (mesh,) = (mesh for mesh in scene.meshes if mesh.name == "Chair")
    glowing = np.array([scene.materials[index].emission[0] > 3 for index in mesh.material])
    assert len(glowing) == 3 * 2 * 12 and glowing.sum() == 3 * 2 * 2
    assert np.ptp(mesh.positions[glowing][:, :, 0], axis=(1,)).max() < 1e-5
    covered = coverage("Chair", "Other")
    assert (covered > 1).sum() <= 0.005 * (covered > 0).sum()


def test_modifiers_that_leave_nothing_leave_others_alone():
    import bpy

    chair, other = copied(), mesh_object("Other", CUBE, INWARD)
    group = chair.vertex_groups.new(name="None")
    chair.modifiers.new("Mask", "MASK").vertex_group = group.name
    bpy.context.view_layer.update()
    unwrap()
    assert [modifier.name for modifier in chair.modifiers] == ["Copier", "Mask"]
    assert "Lightmap" in other.data.uv_layers and not bpy.data.node_groups
    chair.modifiers["Mask"].show_viewport = chair.modifiers["Mask"].show_render = False
    unwrap()
    assert chair.modifiers[-1].name == NAME


def test_object_that_also_makes_instances_goes_on_making_them():
    """A Geometry Nodes modifier that keeps the mesh twice and puts another object on its points."""
    import bpy

    leaf, host = square("Leaf", uvs=None), mesh_object("Host", CUBE, INWARD)
    leaf.scale, leaf.location = (0.1, 0.1, 0.1), (0, 0, 5)
    group = bpy.data.node_groups.new("Group", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    points, info = group.nodes.new("GeometryNodeInstanceOnPoints"), group.nodes.new("GeometryNodeObjectInfo")
    join = group.nodes.new("GeometryNodeJoinGeometry")
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = leaf, True
    group.links.new(start.outputs[0], points.inputs["Points"])
    group.links.new(info.outputs["Geometry"], points.inputs["Instance"])
    for output in (points.outputs[0], start.outputs[0], start.outputs[0]):
        group.links.new(output, join.inputs[0])
    array = host.modifiers.new("Array", "ARRAY")
    array.count = 2
    group.links.new(join.outputs[0], end.inputs[0])
    host.modifiers.new("Group", "NODES").node_group = group
    assert bake() == {"FINISHED"}
    assert host.modifiers[-1].name == NAME
    assert report()["instances"] == 16 and report()["objects"] == 2


def test_faces_made_by_modifiers_alone_are_baked():
    import bpy

    made = mesh_object("Made", [(0, 0, 0), (1, 0, 0)], [])
    made.data.edges.add(1)
    made.data.edges[0].vertices = (0, 1)
    made.modifiers.new("Screw", "SCREW").screw_offset = 1
    bpy.context.view_layer.update()
    furnace()
    assert bake() == {"FINISHED"}
    assert made.hemibake.image is not None and report()["objects"] == 2


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_object_in_edit_mode(mode):
    import bpy

    chair = copied()
    bpy.context.view_layer.objects.active = chair
    bpy.ops.object.mode_set(mode=mode)
    assert bake() == {"FINISHED"}
    assert chair.mode == mode and coverage("Chair").max() == 1


def test_linked_object_becomes_an_occluder_that_is_named(tmp_path):
    import bpy

    copied(name="Far")
    library = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=library)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.hemibake.resolution = 64
    with bpy.data.libraries.load(library, link=True) as (_, linked):
        linked.objects = ["Far"]
    bpy_link(linked.objects[0])
    furnace()
    assert bake() == {"FINISHED"}
    assert report()["objects"] == 1
    assert any("'Far'" in warning and "on a copy" in warning for warning in report()["warnings"])


def test_local_object_with_a_linked_mesh_is_baked(tmp_path):
    import bpy

    square("Far", uvs=None)
    library = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=library)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(library, link=True) as (_, linked):
        linked.meshes = ["Far"]
    near = bpy_link(bpy.data.objects.new("Near", linked.meshes[0]))
    assert bake() == {"FINISHED"}
    assert near.hemibake.image is not None and near.modifiers[0].name == NAME
