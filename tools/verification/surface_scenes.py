"""Scenes of materials: a white box shows what the floor reflects."""

from __future__ import annotations

import math

import bpy
import numpy as np

from .stage import (
    add, box, floor, glow, lamp, link_image, material, patchwork, picture, plane, principled, white_stage, world,
)  # fmt: skip


def shiny() -> None:
    """Metal and glass in parts: what they reflect or let through is not diffuse."""
    floor(material("Half metal", (0.8, 0.6, 0.3), Metallic=0.5, Roughness=0.3))
    box(material("Half glass", (0.5, 0.8, 0.9), Transmission_Weight=0.4), (0.5, 0.3, 0.35))
    box(material("Metal", (0.9, 0.9, 0.9), Metallic=1.0), (-0.7, 0.6, 0.35))
    box(material("White", (0.9, 0.9, 0.9)), (-0.2, -0.8, 0.35))
    lamp("AREA", energy=60, shape="SQUARE", size=0.8)


def mixed_shaders() -> None:
    """Diffuse mixed with Glossy, added to Emission."""
    surface = material("Mixed")
    tree = surface.node_tree
    names = ("BsdfDiffuse", "BsdfGlossy", "Emission", "MixShader", "AddShader")
    diffuse, glossy, emission, mix, both = (tree.nodes.new(f"ShaderNode{name}") for name in names)
    diffuse.inputs["Color"].default_value = (0.9, 0.4, 0.2, 1)
    emission.inputs["Color"].default_value = (0.1, 0.2, 0.6, 1)
    mix.inputs[0].default_value = 0.3
    tree.links.new(diffuse.outputs[0], mix.inputs[1])
    tree.links.new(glossy.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], both.inputs[0])
    tree.links.new(emission.outputs[0], both.inputs[1])
    tree.links.new(both.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    white_stage(surface)


def textured() -> None:
    """An image with its own UV map, turned and repeated."""
    surface = material("Tiles")
    node = link_image(surface, picture("Tiles", patchwork()), "Base Color")
    tree = surface.node_tree
    uv, mapping = tree.nodes.new("ShaderNodeUVMap"), tree.nodes.new("ShaderNodeMapping")
    uv.uv_map = "UVMap"
    mapping.inputs["Rotation"].default_value = (0, 0, 0.6)
    mapping.inputs["Scale"].default_value = (1.7, 1.3, 1)
    mapping.inputs["Location"].default_value = (0.2, 0.4, 0)
    tree.links.new(uv.outputs[0], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], node.inputs["Vector"])
    white_stage(surface)


def textured_extensions() -> None:
    """Images that go on beyond their borders in each way, and one that is not interpolated."""
    lamp("AREA", energy=60, shape="SQUARE", size=0.8)
    box(material("White", (0.9, 0.9, 0.9)), (0, 0, 0.35))
    for index, extension in enumerate(("REPEAT", "EXTEND", "CLIP", "MIRROR")):
        surface = material(extension)
        node = link_image(surface, picture(extension, patchwork(4, index)), "Base Color")
        node.extension, node.interpolation = extension, "Closest" if index == 0 else "Linear"
        tile = plane(extension, surface, 2, location=(2 * (index % 2) - 1, 2 * (index // 2) - 1, 0))
        layer = tile.data.uv_layers[0]
        uvs = np.empty(8, np.float32)
        layer.uv.foreach_get("vector", uvs)
        layer.uv.foreach_set("vector", 2.2 * uvs - 0.6)


def procedural() -> None:
    """Noise, which only Blender evaluates."""
    surface = material("Noise")
    noise = surface.node_tree.nodes.new("ShaderNodeTexNoise")
    surface.node_tree.links.new(noise.outputs["Color"], principled(surface).inputs["Base Color"])
    white_stage(surface)


def vertex_colours() -> None:
    surface = material("Painted")
    node = surface.node_tree.nodes.new("ShaderNodeVertexColor")
    node.layer_name = "Paint"
    surface.node_tree.links.new(node.outputs["Color"], principled(surface).inputs["Base Color"])
    paint = white_stage(surface).data.color_attributes.new("Paint", "FLOAT_COLOR", "CORNER")
    paint.data.foreach_set("color", [0.9, 0.1, 0.1, 1, 0.1, 0.9, 0.1, 1, 0.1, 0.1, 0.9, 1, 0.9, 0.9, 0.9, 1])


def several_materials() -> None:
    """Faces of one object with four materials, one slot of them empty."""
    floor()
    obj = box()
    obj.data.materials.append(material("Green", (0.1, 0.7, 0.2)))
    obj.data.materials.append(glow(3, (1, 0.8, 0.5)))
    obj.data.materials.append(None)
    for polygon in obj.data.polygons:
        polygon.material_index = polygon.index % 4
    lamp("AREA", energy=40, shape="SQUARE", size=0.8)


def _leaf(surface: bpy.types.Material) -> None:
    """Add a surface with holes between lamp and floor."""
    floor()
    leaf = plane("Leaf", surface, 1.6, location=(0.1, 0, 0.7), rotation_euler=(math.pi, 0, 0))
    leaf.hemibake.role = "OCCLUDER"
    lamp("AREA", energy=60, shape="SQUARE", size=0.2)
    world(0.2)


def _leaf_image() -> bpy.types.Image:
    pixels = patchwork(8, 3)
    pixels[..., 3] = np.random.default_rng(4).uniform(0, 1, (8, 8))
    return picture("Leaves", pixels)


def alpha_clipped() -> None:
    surface = material("Leaves", (0.2, 0.6, 0.2))
    node = link_image(surface, _leaf_image(), "Alpha", "Alpha")
    tree = surface.node_tree
    cut = tree.nodes.new("ShaderNodeMath")
    cut.operation = "GREATER_THAN"
    cut.inputs[1].default_value = 0.5
    tree.links.new(node.outputs["Alpha"], cut.inputs[0])
    tree.links.new(cut.outputs[0], principled(surface).inputs["Alpha"])
    _leaf(surface)


def alpha_blended() -> None:
    surface = material("Leaves", (0.2, 0.6, 0.2))
    link_image(surface, _leaf_image(), "Alpha", "Alpha")
    _leaf(surface)


def alpha_constant() -> None:
    _leaf(material("Veil", (0.2, 0.6, 0.2), Alpha=0.35))


def alpha_by_mix() -> None:
    """A Transparent BSDF mixed in by an image's alpha."""
    surface = material("Leaves")
    tree = surface.node_tree
    names = ("TexImage", "BsdfTransparent", "MixShader")
    image, clear, mix = (tree.nodes.new(f"ShaderNode{name}") for name in names)
    image.image = _leaf_image()
    tree.links.new(image.outputs["Alpha"], mix.inputs[0])
    tree.links.new(clear.outputs[0], mix.inputs[1])
    tree.links.new(principled(surface).outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    _leaf(surface)


def culled_backs() -> None:
    """Two sheets whose backs are see-through: one shades the floor, the other only reflects light to it."""
    floor()
    surface = material("One-sided", (0.7, 0.4, 0.2))
    surface.use_backface_culling = True
    up = plane("Up", surface, 0.8, location=(-0.6, 0.3, 0.5))
    down = plane("Down", surface, 0.8, location=(0.6, -0.3, 0.5), rotation_euler=(math.pi + 0.2, 0, 0))
    up.hemibake.role = down.hemibake.role = "OCCLUDER"
    lamp("AREA", energy=60, shape="SQUARE", size=0.4)


def dark_backs() -> None:
    """A ball seen from inside and a sheet: their backs reflect nothing, here and in the reference."""
    floor()
    sheet = plane("Sheet", material("Sheet", (0.9, 0.9, 0.9)), 0.8, location=(0.6, -0.3, 0.5))
    sheet.hemibake.role = "OCCLUDER"
    half = add("Bowl", bpy.ops.mesh.primitive_uv_sphere_add, material("Bowl", (0.2, 0.8, 0.5)),
               segments=24, ring_count=12, radius=0.5, location=(-0.7, 0.3, 0.52))  # fmt: skip
    half.data.flip_normals()
    half.hemibake.role = "OCCLUDER"
    lamp("AREA", energy=60, shape="SQUARE", size=0.4)


SCENES = (
    shiny, mixed_shaders, textured, textured_extensions, procedural, vertex_colours, several_materials,
    alpha_clipped, alpha_blended, alpha_constant, alpha_by_mix, culled_backs, dark_backs,
)  # fmt: skip
