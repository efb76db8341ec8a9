"""The preview shows the lightmap and gives everything back."""

import numpy as np
import pytest

from tests.blender.things import (
    CUBE,
    INWARD,
    bpy_link,
    furnace,
    material,
    mesh_object,
    part,
    report,
    shrink_charts,
    snapshot,
    square,
)


@pytest.fixture
def baked():
    """Return a baked room with a material, an object without one, and one with its own slot."""
    import bpy

    room, bare, own = furnace(), square("Bare", uvs=None), square("Own", uvs=None, surface=material("Mesh's"))
    bare.location, own.location = (0.2, 0.2, 0.3), (0.3, 0.3, 0.6)
    bare.scale = own.scale = (0.3, 0.3, 0.3)
    own.material_slots[0].link = "OBJECT"
    own.material_slots[0].material = material("Object's")
    bpy.ops.hemibake.bake()
    return room, bare, own


def test_every_slot_shows_the_lightmap(baked):
    import bpy

    bpy.ops.hemibake.preview()
    for obj in baked:
        (slot,) = obj.material_slots
        assert slot.material.name.endswith("(lightmap)")
        (texture,) = [node for node in slot.material.node_tree.nodes if node.type == "TEX_IMAGE"]
        (uv,) = [node for node in slot.material.node_tree.nodes if node.type == "UVMAP"]
        assert texture.image == obj.hemibake.image and uv.uv_map == "Lightmap"


def test_switched_off_everything_is_as_before(baked):
    import bpy

    before = snapshot()
    bpy.ops.hemibake.preview()
    assert snapshot() != before
    bpy.ops.hemibake.preview()
    assert snapshot() == before
    assert [len(obj.data.materials) for obj in baked] == [1, 0, 1]


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_faces_of_a_mesh_without_slots_keep_their_material_indices(mode):
    import bpy

    first, plain = mesh_object("First", CUBE, INWARD), mesh_object("Plain", CUBE, INWARD)
    first.data.polygons.foreach_set("material_index", [3, 1, 0, 2, 32767, 4])
    second = bpy_link(bpy.data.objects.new("Second", first.data))
    second.location, plain.location = (3, 0, 0), (0, 3, 0)
    bpy.ops.hemibake.bake()
    bpy.context.view_layer.objects.active = second
    bpy.ops.object.mode_set(mode=mode)
    before = snapshot()
    bpy.ops.hemibake.preview()
    assert [len(obj.material_slots) for obj in (first, second, plain)] == [1, 1, 1]
    bpy.ops.hemibake.preview()
    assert snapshot() == before
    bpy.ops.object.mode_set(mode="OBJECT")
    assert [polygon.material_index for polygon in first.data.polygons] == [3, 1, 0, 2, 32767, 4]


def test_originals_survive_saving_and_loading(baked, tmp_path):
    import bpy

    before = snapshot()
    bpy.ops.hemibake.preview()
    path = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    bpy.ops.hemibake.preview()
    assert snapshot()["slots"] == before["slots"]
    assert snapshot()["materials"] == before["materials"]


def test_bake_under_the_preview_sees_the_originals(baked):
    import bpy

    before = report()
    bpy.ops.hemibake.preview()
    bpy.ops.hemibake.bake()
    assert report()["added_flux"] == before["added_flux"]


def test_nothing_baked_is_an_error():
    import bpy

    square()
    with pytest.raises(RuntimeError, match="Bake first"):
        bpy.ops.hemibake.preview()


def shown(obj):
    """Return the material that an object shows in the preview."""
    import bpy

    bpy.ops.hemibake.bake()
    bpy.ops.hemibake.preview()
    return obj.material_slots[0].material


def test_what_is_no_shader_is_kept(baked):
    import bpy

    original = baked[0].data.materials[0]
    original.use_backface_culling, original.surface_render_method = True, "BLENDED"
    original.use_transparent_shadow, original.use_fake_user = False, True
    original["note"] = 7
    copy = shown(baked[0])
    assert copy.use_backface_culling and copy.surface_render_method == "BLENDED"
    assert not copy.use_transparent_shadow and not copy.use_fake_user and copy["note"] == 7
    bpy.ops.hemibake.preview()
    assert original.use_fake_user and baked[0].material_slots[0].material == original


def test_muted_and_glossy_shaders_stay():
    obj = furnace()
    tree = obj.data.materials[0].node_tree
    for kind, settings in (
        ("ShaderNodeBsdfDiffuse", {"mute": True}),
        ("ShaderNodeBsdfToon", {"component": "GLOSSY"}),
        ("ShaderNodeBsdfGlass", {}),
    ):
        node = tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
    copy = shown(obj)
    kinds = {node.bl_idname for node in copy.node_tree.nodes}
    assert {"ShaderNodeBsdfDiffuse", "ShaderNodeBsdfToon", "ShaderNodeBsdfGlass"} <= kinds
    assert "ShaderNodeBsdfPrincipled" not in kinds


def test_groups_are_copied_once_and_removed_with_the_preview(tmp_path):
    import bpy

    obj = furnace()
    tree = obj.data.materials[0].node_tree
    group = bpy.data.node_groups.new("Paint", "ShaderNodeTree")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    shader = group.nodes.new("ShaderNodeBsdfDiffuse")
    group.links.new(shader.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
    mix = tree.nodes.new("ShaderNodeMixShader")
    for socket in mix.inputs[1:3]:
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = group
        tree.links.new(node.outputs[0], socket)
    tree.links.new(mix.outputs[0], tree.get_output_node("ALL").inputs["Surface"])
    bpy.ops.hemibake.bake()
    before = snapshot()
    bpy.ops.hemibake.preview()
    assert sorted(group.name for group in bpy.data.node_groups) == ["Paint", "Paint (lightmap)"]
    path = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    bpy.ops.hemibake.preview()
    after = snapshot()
    assert [after[name] for name in ("materials", "node groups", "slots")] == [
        before[name] for name in ("materials", "node groups", "slots")
    ]


def view3d():
    """Return a 3D view, for `temp_override`."""
    import bpy

    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    return {"window": window, "screen": window.screen, "area": area}


@pytest.mark.parametrize(
    ("before", "meanwhile", "after"),
    [("SOLID", None, "SOLID"), ("SOLID", "WIREFRAME", "WIREFRAME"), ("RENDERED", None, "RENDERED")],
)
def test_solid_view_shows_materials_while_the_preview_does(baked, before, meanwhile, after):
    import bpy

    view = view3d()
    shading = view["area"].spaces.active.shading
    shading.type = before
    with bpy.context.temp_override(**view):
        bpy.ops.hemibake.preview()
        assert shading.type == ("MATERIAL" if before == "SOLID" else before)
        shading.type = meanwhile or shading.type
        bpy.ops.hemibake.preview()
    assert shading.type == after and not view["screen"].keys()


def test_button_shows_whether_there_is_a_preview(baked):
    import bpy

    shows_preview = part("operators.result.preview").shows_preview
    assert not shows_preview(bpy.context.scene)
    bpy.ops.hemibake.preview()
    assert shows_preview(bpy.context.scene)


@pytest.mark.parametrize("count", [1, 2, 3, 1009])
def test_every_number_of_an_instance_has_its_place(count):
    """The table is read as the shader reads it."""
    places = part("operators.result.instance_uv_table")
    random = np.random.default_rng(count)
    chosen = [
        places.InstanceUvTransform(int(bits), index % 3, float(index), (float(-index), 0.5))
        for index, bits in enumerate(random.choice(1 << 31, count, replace=False) * 2 + 1)
    ]
    table = places.place_table(chosen, [0, 1, 2])
    texels, one = table.texels.reshape(-1, 4), np.float32(1)
    for place, number in zip(chosen, places.shader_numbers([place.bits for place in chosen]), strict=True):
        number = number * np.float32(table.buckets)
        head = texels[int(number)]
        found = texels[int(np.floor(number % one * head[1]) + head[0])]
        assert tuple(found) == (*place.offset, place.scale, place.image)


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_an_open_preview_follows_the_next_bake(baked, mode):
    """New objects and other lightmaps show; hidden, all is as it was."""
    import bpy

    room, bare, own = baked
    bpy.ops.hemibake.preview()
    new = square("New", uvs=None)
    new.location, new.scale, new.hemibake.atlas = (0.6, 0.2, 0.4), (0.2, 0.2, 0.2), "Another"
    own.hemibake.atlas = "Another"
    surface = bpy.data.materials["Object's"]
    bpy.context.view_layer.objects.active = bare
    bpy.ops.object.mode_set(mode=mode)
    bpy.ops.hemibake.bake()
    assert bpy.context.mode.startswith(mode)
    bpy.ops.object.mode_set(mode="OBJECT")
    for obj, name in ((room, "Lightmap"), (bare, "Lightmap"), (own, "Another"), (new, "Another")):
        (slot,) = obj.material_slots
        (texture,) = [node for node in slot.material.node_tree.nodes if node.type == "TEX_IMAGE"]
        assert texture.image.name == name == obj.hemibake.image.name
    previews = [item for item in bpy.data.materials if "hemibake_preview" in item]
    assert len(previews) == len({obj.material_slots[0].material for obj in (room, bare, own, new)})
    bpy.ops.hemibake.preview()
    assert [len(obj.data.materials) for obj in (room, bare, own, new)] == [1, 0, 1, 0]
    assert own.material_slots[0].material == surface
    assert not [item for item in bpy.data.materials if "hemibake_preview" in item]


def test_slots_that_are_filled_or_added_meanwhile_stay_and_are_baked(baked):
    """Whoever gives an object another material while the preview is shown wants that one."""
    import bpy

    room, bare, own = baked
    bpy.ops.hemibake.preview()
    black = material("Black", (0, 0, 0))
    room.material_slots[0].material = black
    own.data.materials.append(black)
    bpy.ops.hemibake.bake()
    assert room.hemibake.image is not None
    assert np.asarray(room.hemibake.image.pixels)[::4].max() < 1
    bpy.ops.hemibake.preview()
    assert room.material_slots[0].material == black
    assert [slot.material.name for slot in own.material_slots] == ["Object's", "Black"]
    assert len(bare.material_slots) == 0


def test_charts_that_were_moved_since_the_bake_are_told(baked, capfd):
    """Of objects, and of what only instances show; the lightmaps show all the same."""
    import bpy

    room, bare, own = baked
    bpy.context.scene.hemibake.resolution = 257
    chairs = bpy.data.collections.new("Chairs")
    chair = square("Chair", uvs=None)
    bpy.context.scene.collection.objects.unlink(chair)
    chairs.objects.link(chair)
    for number in range(2):
        instance = bpy_link(bpy.data.objects.new(f"Instance {number}", None))
        instance.instance_type, instance.instance_collection = "COLLECTION", chairs
        instance.location, instance.scale = (0.2, 0.6, 0.3 + 0.3 * number), (0.2, 0.2, 0.2)
    bpy.ops.hemibake.bake()
    bpy.ops.hemibake.preview()
    assert "changed since the bake" not in capfd.readouterr().out
    for obj in (bare, chair):
        shrink_charts(obj)
    bpy.ops.hemibake.preview()
    assert bpy.ops.hemibake.preview() == {"FINISHED"}
    said = capfd.readouterr().out
    assert "changed since the bake: 'Bare', 'Chair'." in said
    assert all(obj.hemibake.slots for obj in (room, bare, own, chair))


def test_a_material_override_that_hides_lightmaps_is_named(baked, capfd):
    import bpy

    layer = bpy.context.view_layer
    layer.material_override = material("Clay")
    bpy.ops.hemibake.preview()
    assert f"View layer '{layer.name}': its Material Override hides the lightmaps" in capfd.readouterr().out
    bpy.ops.hemibake.preview()
    layer.material_override = None
    bpy.ops.hemibake.preview()
    assert "Material Override" not in capfd.readouterr().out
