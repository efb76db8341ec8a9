"""Exports with complete maps: albedo x light + emission as sRGB pictures of unlit materials."""

import numpy as np
import pytest

from tests.blender.gltf_file import unique_rows
from tests.blender.test_export import bake, by_collections, expected, export
from tests.blender.things import SQUARE_UVS, files_below, furnace, material, part, pixels, snapshot, square


def unlit(path, **options):
    return export(path, engine="UNLIT", **options)


def picture(file, node, folder):
    """Return the material of a node and the texels of its picture, linear."""
    import bpy

    (primitive,) = file.primitives(node)
    surface = file.json["materials"][primitive["material"]]
    texture = surface["pbrMetallicRoughness"]["baseColorTexture"]
    assert texture.get("texCoord", 0) == 0 and "KHR_materials_unlit" in surface["extensions"]
    image = file.json["images"][file.json["textures"][texture["index"]]["source"]]
    copy = folder / f"copy.{image['mimeType'][6:]}"
    copy.write_bytes(file.image_bytes(image))
    loaded = bpy.data.images.load(str(copy))
    loaded.colorspace_settings.name = "Non-Color"
    values = pixels(loaded)[..., :3]
    bpy.data.images.remove(loaded)
    return surface, part("engine.scene.color").srgb_to_linear(values)


@pytest.mark.parametrize(("kind", "ending", "off"), [("PNG", ".glb", 0.006), ("JPEG", ".gltf", 0.02)])
def test_light_color_and_emission(tmp_path, kind, ending, off):
    """A closed cube of albedo 0.5 and emission 1 has E/pi 2, so 0.5 x 2 + 1, two stops darker."""
    import bpy

    furnace()
    bpy.context.scene.hemibake.resolution = 32
    bake()
    before = snapshot()
    path = tmp_path / f"room{ending}"
    file = unlit(path, picture_format=kind, picture_size="512", picture_exposure=-2.0)
    assert snapshot() == before
    (node,) = file.nodes("Furnace")
    _, values = picture(file, node, tmp_path)
    assert values.shape[:2] == (512, 512)
    covered = values[values.max(axis=-1) > 0.1]
    assert len(covered) > 0.3 * 512 * 512
    np.testing.assert_allclose(np.percentile(covered, (2, 50, 98)), 0.5, atol=off)
    names = set(file.primitives(node)[0]["attributes"])
    assert "TEXCOORD_0" in names and "TEXCOORD_1" not in names
    known = path.parent / "room.Lightmap.jpg"
    assert known.exists() == (ending == ".gltf")


def test_texture_and_places(tmp_path):
    """Texels of a texture appear at the lightmap UVs of an object and of instances, in the map's own size."""
    import bpy

    image = bpy.data.images.new("Checker", 2, 1)
    image.pixels.foreach_set([1, 0, 0, 1, 0, 0, 1, 1])
    surface = material("Textured", emission=0.0)
    nodes, links = surface.node_tree.nodes, surface.node_tree.links
    texture, uv = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeUVMap")
    texture.image, texture.interpolation, uv.uv_map = image, "Closest", "Color"
    links.new(uv.outputs[0], texture.inputs[0])
    links.new(texture.outputs[0], nodes["Principled BSDF"].inputs["Emission Color"])
    nodes["Principled BSDF"].inputs["Emission Strength"].default_value = 1.0
    nodes["Principled BSDF"].inputs["Base Color"].default_value = (0, 0, 0, 1)
    source = square("Source", SQUARE_UVS, surface)
    layer = source.data.uv_layers.new(name="Color")
    layer.uv.foreach_set("vector", [0, 0, 1, 0, 1, 1, 0, 1])
    by_collections(source, [(3.0, 0, 0), (6.0, 0, 0)])
    bpy.context.scene.hemibake.resolution = 64
    bake()
    file = unlit(tmp_path / "room.glb")
    surfaces = part("operators.gltf.export_items").ExportItems(bpy.context).all
    found = [file.corners(node, 0) for node in file.nodes("Source")]
    for item in surfaces:
        rows = expected(source, item.place.layer, item.place.scale, item.place.offset)
        assert any(rows.shape == other.shape and np.allclose(rows, other, atol=1e-4) for other in found)
    for node in file.nodes("Source"):
        _, values = picture(file, node, tmp_path)
        rows = file.corners(node, 0)
        for x, color in ((0.25, (1, 0, 0)), (0.75, (0, 0, 1))):
            low, high = rows[:, 3:].min(axis=0), rows[:, 3:].max(axis=0)
            u, v = low + (high - low) * (x, 0.5)
            height, width = values.shape[:2]
            np.testing.assert_allclose(values[int(v * height), int(u * width)], color, atol=0.02)
    assert unique_rows(np.concatenate(found)).shape[0] > 4


def test_transparent_objects_are_named(tmp_path, capfd):
    surface = material("Glass", emission=1.0)
    node = surface.node_tree.nodes["Principled BSDF"]
    node.inputs["Alpha"].default_value = 0.5
    surface.surface_render_method = "BLENDED"
    pane = square("Pane", SQUARE_UVS, surface)
    square("Wall", SQUARE_UVS, material("Wall", emission=1.0)).location.z = 3
    assert pane.name == "Pane"
    bake()
    capfd.readouterr()
    unlit(tmp_path / "room.glb")
    told = "".join(capfd.readouterr())
    assert "opaque in an unlit file: 'Pane'." in told
    assert set(map(str, files_below(tmp_path))) == {"room.glb"}
