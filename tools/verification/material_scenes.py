"""Scenes whose materials a bake evaluates in another way than a viewport: glass, unlit, displaced, by ray."""

from __future__ import annotations

import json
import math
import struct
import tempfile
from pathlib import Path

import bpy
import numpy as np

from tools.verification.scenes import (
    BY_DESIGN,
    NOTES,
    ORIGINALS,
    add,
    box,
    lamp,
    material,
    scene,
    stage,
    world,
)


def shell(surface: bpy.types.Material, opening: tuple[float, float]) -> bpy.types.Object:
    """Return a closed room of 3.2 x 2.6 x 2.2 m with an opening, (width, height), at y = 1.3 m."""
    wide, low, high = opening[0] / 2, 1.2 - opening[1] / 2, 1.2 + opening[1] / 2
    outer = [(-1.6, 1.3, 0), (1.6, 1.3, 0), (1.6, 1.3, 2.2), (-1.6, 1.3, 2.2)]
    inner = [(-wide, 1.3, low), (wide, 1.3, low), (wide, 1.3, high), (-wide, 1.3, high)]
    back = [(x, -1.3, z) for x, _, z in outer]
    frame = [(side, (side + 1) % 4, 4 + (side + 1) % 4, 4 + side) for side in range(4)]
    sides = [(8 + side, 8 + (side + 1) % 4, (side + 1) % 4, side) for side in range(4)]
    mesh = bpy.data.meshes.new("Shell")
    mesh.from_pydata(outer + inner + back, [], [*frame, *sides, (11, 10, 9, 8)])
    mesh.update()
    obj = bpy.data.objects.new("Shell", mesh)
    bpy.context.scene.collection.objects.link(obj)
    mesh.materials.append(surface)
    return obj


def pane(surface: bpy.types.Material, size: tuple[float, float, float]) -> bpy.types.Object:
    """Return a closed slab before the opening of `shell`, without a lightmap."""
    obj = add("Pane", bpy.ops.mesh.primitive_cube_add, surface, size=1, location=(0, 1.36, 1.2))
    obj.scale, obj.hemibake.role = size, "NO_LIGHTMAP"
    return obj


def closure(kind: str, **inputs: object) -> bpy.types.Material:
    """Return a material of one closure."""
    surface = material(kind)
    tree = surface.node_tree
    node = tree.nodes.new(kind)
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    tree.links.new(node.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    return surface


@scene
def glass_window():
    """A closed room that a white sky lights through a closed slab of glass."""
    shell(material("Walls", (0.72, 0.7, 0.66)), (3.0, 2.0))
    box(None, (0.3, -0.2, 0.35))
    pane(closure("ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.45), (3.1, 0.03, 2.1))
    world((0.9, 0.95, 1.0), 2.0)


NOTES["glass_window"] = "without refraction"
BY_DESIGN["glass_window"] = (2.0, 1.5)


@scene
def window_by_shadow_rays():
    """The window of interiors: clear for shadow rays and after a bounce, glass for a camera."""
    shell(material("Walls", (0.6, 0.64, 0.7)), (1.5, 1.1))
    surface = closure("ShaderNodeBsdfGlass", Roughness=0.0)
    tree = surface.node_tree
    path, either, mix, clear = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("LightPath", "Math", "MixShader", "BsdfTransparent")
    )
    either.operation = "MAXIMUM"
    clear.inputs["Color"].default_value = (0.8, 0.95, 0.9, 1)
    glass = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBsdfGlass")
    for index, name in enumerate(("Is Shadow Ray", "Is Diffuse Ray")):
        tree.links.new(path.outputs[name], either.inputs[index])
    for socket, output in zip(mix.inputs, (either, glass, clear), strict=True):
        tree.links.new(output.outputs[0], socket)
    tree.links.new(mix.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    pane(surface, (1.6, 0.04, 1.2))
    world((0.8, 0.9, 1.0), 1.2)
    sun = lamp("SUN", energy=3.0, angle=0.03)
    sun.rotation_euler = (-0.9, 0, 0.2)


@scene
def volume_box():
    """A box of fog without a surface, which a bake leaves out."""
    stage()
    surface = material("Fog")
    tree = surface.node_tree
    output, volume = tree.get_output_node("CYCLES"), tree.nodes.new("ShaderNodeVolumeScatter")
    tree.links.remove(output.inputs["Surface"].links[0])
    volume.inputs["Density"].default_value = 1e-6
    tree.links.new(volume.outputs[0], output.inputs["Volume"])
    fog = add("Fog", bpy.ops.mesh.primitive_cube_add, surface, size=1.2, location=(-0.3, -0.2, 0.8))
    fog.hemibake.role = "NO_LIGHTMAP"
    lamp("SUN", energy=3.0, angle=0.1)


NOTES["volume_box"] = "are not baked"


@scene
def one_sided_panel():
    """A panel that emits on its front and lets light pass from its back."""
    stage()
    surface = closure("ShaderNodeEmission", Strength=4.0)
    tree = surface.node_tree
    side, mix, clear = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("NewGeometry", "MixShader", "BsdfTransparent")
    )
    emission = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")
    tree.links.new(side.outputs["Backfacing"], mix.inputs[0])
    for socket, output in zip(mix.inputs[1:], (emission, clear), strict=True):
        tree.links.new(output.outputs[0], socket)
    tree.links.new(mix.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    panel = add("Panel", bpy.ops.mesh.primitive_plane_add, surface, size=1.1, location=(-0.4, 0.2, 1.3))
    panel.rotation_euler, panel.hemibake.role = (math.pi, 0, 0), "NO_LIGHTMAP"
    lamp("AREA", (0.3, 0.3, 2.6), (0, 0, 0), energy=40, shape="SQUARE", size=0.4)


@scene
def rough_metal():
    """A closed room with half its walls of rough metal, which lights the others."""
    walls = shell(material("Walls", (0.6, 0.6, 0.6)), (1.4, 1.0))
    walls.data.materials.append(material("Brushed", (0.8, 0.65, 0.5), Metallic=0.6, Roughness=0.75))
    for polygon in walls.data.polygons:
        polygon.material_index = int(polygon.index % 4 == 1)
    lamp("AREA", (0.2, 0, 2.1), (0.2, 0.001, 0), energy=50, shape="SQUARE", size=0.7)


@scene
def true_displacement():
    """A floor that a render displaces: the reference has it flat, and the report names it."""
    stage()
    surface = bpy.data.objects["Floor"].data.materials[0]
    tree = surface.node_tree
    node = tree.nodes.new("ShaderNodeDisplacement")
    node.inputs["Height"].default_value = 0.9
    tree.links.new(node.outputs[0], tree.get_output_node("CYCLES").inputs["Displacement"])
    surface.displacement_method = "DISPLACEMENT"
    lamp("AREA", energy=60, shape="SQUARE", size=0.5)


NOTES["true_displacement"] = "true displacement is not baked"


@scene
def gltf_unlit():
    """A backdrop around the stage with the unlit extension of glTF, as Blender's importer makes it."""
    stage()
    lamp("AREA", energy=60, shape="SQUARE", size=0.5)
    world(strength=0.5)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "backdrop.glb"
        path.write_bytes(_unlit_file())
        bpy.ops.import_scene.gltf(filepath=str(path))
    bpy.data.objects["Backdrop"].hemibake.role = "NO_LIGHTMAP"


def _unlit_file() -> bytes:
    """Return a binary glTF file: a square of 5 m, 1.4 m above the ground, with an unlit material."""
    corners = np.array([[-2.5, 1.4, -2.5], [2.5, 1.4, -2.5], [2.5, 1.4, 2.5], [-2.5, 1.4, 2.5]], "<f4")
    indices = np.array([0, 1, 2, 0, 2, 3], "<u2")
    data = corners.tobytes() + indices.tobytes()
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "Backdrop"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [
            {
                "name": "Unlit",
                "pbrMetallicRoughness": {"baseColorFactor": [0.9, 0.3, 0.2, 1]},
                "extensions": {"KHR_materials_unlit": {}},
            }
        ],
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": corners.nbytes},
            {"buffer": 0, "byteOffset": corners.nbytes, "byteLength": indices.nbytes},
        ],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": 4,
                "type": "VEC3",
                "min": corners.min(axis=0).tolist(),
                "max": corners.max(axis=0).tolist(),
            },
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    parts = ((text, 0x4E4F534A), (data, 0x004E4942))
    chunks = b"".join(struct.pack("<II", len(part), kind) + part for part, kind in parts)
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


@scene
def world_by_rays():
    """A world that only the camera sees as red."""
    stage()
    tree = world((0.3, 0.5, 0.7), 1.5).node_tree
    kinds = ("LightPath", "MixShader", "Background")
    path, mix, red = (tree.nodes.new(f"ShaderNode{kind}") for kind in kinds)
    red.inputs["Color"].default_value = (5, 0, 0, 1)
    tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
    tree.links.new(tree.nodes["Background"].outputs[0], mix.inputs[1])
    tree.links.new(red.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.nodes["World Output"].inputs["Surface"])


@scene
def world_spot():
    """A procedural world with a spot of light that is 3 degrees wide."""
    stage()
    tree = world(strength=1.0).node_tree
    coordinates, dot, cut, scale = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "VectorMath", "Math", "Math")
    )
    dot.operation, cut.operation, scale.operation = "DOT_PRODUCT", "GREATER_THAN", "MULTIPLY_ADD"
    dot.inputs[1].default_value = (0.48, 0.36, 0.8)
    cut.inputs[1].default_value = math.cos(math.radians(1.5))
    scale.inputs[1].default_value, scale.inputs[2].default_value = 400, 0.3
    tree.links.new(coordinates.outputs["Generated"], dot.inputs[0])
    tree.links.new(dot.outputs["Value"], cut.inputs[0])
    tree.links.new(cut.outputs[0], scale.inputs[0])
    tree.links.new(scale.outputs[0], tree.nodes["Background"].inputs["Color"])


@scene
def sky_sun_tiny():
    """A sun disc of 0.1 degrees."""
    stage()
    tree = world(strength=0.2).node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    types = {item.identifier for item in sky.bl_rna.properties["sky_type"].enum_items}
    sky.sky_type = "SINGLE_SCATTERING" if "SINGLE_SCATTERING" in types else "NISHITA"
    sky.sun_elevation, sky.sun_rotation, sky.sun_size = (math.radians(angle) for angle in (38, -70, 0.1))
    tree.links.new(sky.outputs[0], tree.nodes["Background"].inputs["Color"])


ORIGINALS.update(dict.fromkeys(("gltf_unlit", "world_by_rays", "sky_sun_tiny"), "Floor"))
