"""The preview shows the lightmap and gives everything back."""

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
    assert report()["energies"] == before["energies"]


def test_preview_emits_reflectance_times_lightmap_plus_emission(baked):
    import bpy

    bpy.ops.hemibake.preview()
    read = part("operators.scene.materials.materials").read_material
    room = baked[0]
    nodes = room.material_slots[0].material.node_tree.nodes
    light = next(node for node in nodes if node.label.startswith("Reflectance"))
    original = read(room.data.materials[0], [], None)
    assert tuple(light.inputs[1].default_value) == pytest.approx(tuple(original.reflectance))
    assert tuple(light.inputs[2].default_value) == pytest.approx(tuple(original.emission))


def test_nothing_baked_is_an_error():
    import bpy

    square()
    with pytest.raises(RuntimeError, match="Bake first"):
        bpy.ops.hemibake.preview()
