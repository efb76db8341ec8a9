"""What the scenes are made of: surfaces, lamps, worlds, images."""

from __future__ import annotations

import math
from collections.abc import Callable

import bpy
import numpy as np


def material(name: str, colour=(0.6, 0.6, 0.6), **inputs) -> bpy.types.Material:
    """Return a material with a Principled BSDF; inputs are named with _ for blanks."""
    result = bpy.data.materials.new(name)
    node = _tree(result).nodes["Principled BSDF"]
    node.inputs["Base Color"].default_value = (*colour, 1)
    for socket, value in inputs.items():
        node.inputs[socket.replace("_", " ")].default_value = value
    return result


def glow(strength: float, colour=(1, 0.9, 0.7), base=(0.2, 0.2, 0.2)) -> bpy.types.Material:
    """Return a material that emits."""
    return material("Glow", base, Emission_Color=(*colour, 1), Emission_Strength=strength)


def principled(surface: bpy.types.Material) -> bpy.types.Node:
    """Return a material's Principled BSDF."""
    return surface.node_tree.nodes["Principled BSDF"]


def add(name: str, maker: Callable, surface: bpy.types.Material | None = None, **options) -> bpy.types.Object:
    """Add a primitive and return it; other options than the operator's are attributes of the object."""
    attributes = {key: options.pop(key) for key in ("scale", "rotation_euler") if key in options}
    maker(**options)
    obj = bpy.context.object
    obj.name = name
    for key, value in attributes.items():
        setattr(obj, key, value)
    if surface is not None:
        obj.data.materials.append(surface)
    return obj


def plane(name: str, surface: bpy.types.Material | None, size: float, **options) -> bpy.types.Object:
    return add(name, bpy.ops.mesh.primitive_plane_add, surface, size=size, **options)


def floor(surface: bpy.types.Material | None = None) -> bpy.types.Object:
    return plane("Floor", surface or material("Floor"), 4)


def box(surface: bpy.types.Material | None = None, location=(0.4, 0.2, 0.35), **options) -> bpy.types.Object:
    """Add a cube of 0.6 m, by default a little above the floor."""
    surface = surface or material("Box", (0.7, 0.3, 0.2))
    return add("Box", bpy.ops.mesh.primitive_cube_add, surface, size=0.6, location=location, **options)


def stage() -> None:
    """Add a floor and a box."""
    floor()
    box()


def white_stage(surface: bpy.types.Material) -> bpy.types.Object:
    """Add a floor with a surface, a white box that shows what it reflects, and a lamp; return the floor."""
    obj = floor(surface)
    box(material("White", (0.9, 0.9, 0.9)))
    lamp("AREA", energy=60, shape="SQUARE", size=0.8)
    return obj


def lamp(kind: str, location=(-0.6, -0.4, 1.8), aim=(0.2, 0.1, 0), **values) -> bpy.types.Object:
    """Add a lamp that shines towards a point."""
    data = bpy.data.lights.new("Lamp", kind)
    for name, value in values.items():
        setattr(data, name, value)
    obj = bpy.data.objects.new("Lamp", data)
    link(obj)
    obj.location = location
    x, y, z = np.subtract(aim, location)
    obj.rotation_euler = (math.acos(-z / math.hypot(x, y, z)), 0, math.atan2(y, x) - math.pi / 2)
    return obj


def link(obj: bpy.types.Object) -> bpy.types.Object:
    """Show a new object."""
    bpy.context.scene.collection.objects.link(obj)
    return obj


def into_collection(name: str, obj: bpy.types.Object) -> bpy.types.Collection:
    """Move an object into a new collection that only instances show."""
    collection = bpy.data.collections.new(name)
    bpy.context.scene.collection.objects.unlink(obj)
    collection.objects.link(obj)
    return collection


def show(collection: bpy.types.Collection, location, **attributes) -> bpy.types.Object:
    """Add an instance of a collection."""
    obj = link(bpy.data.objects.new(f"{collection.name} shown", None))
    obj.instance_type, obj.instance_collection = "COLLECTION", collection
    obj.location = location
    for name, value in attributes.items():
        setattr(obj, name, value)
    return obj


def world(strength: float = 1.0, colour=(0.5, 0.6, 0.8)) -> bpy.types.NodeTree:
    """Add a world of one colour and return its nodes."""
    result = bpy.data.worlds.new("World")
    node = _tree(result).nodes["Background"]
    node.inputs["Color"].default_value = (*colour, 1)
    node.inputs["Strength"].default_value = strength
    bpy.context.scene.world = result
    return result.node_tree


def world_image(image: bpy.types.Image, strength: float = 1.0) -> tuple[bpy.types.NodeTree, bpy.types.Node]:
    """Add a world that is an equirectangular image; return its nodes and the texture."""
    tree = world(strength)
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = image
    tree.links.new(node.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    return tree, node


def picture(name: str, pixels: np.ndarray, space: str = "sRGB", is_float: bool = False) -> bpy.types.Image:
    """Return a packed image of (h, w, 4) numbers."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height, alpha=True, float_buffer=is_float)
    image.colorspace_settings.name = space
    image.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).ravel())
    image.update()
    image.pack()
    return image


def patchwork(size: int = 8, seed: int = 0) -> np.ndarray:
    """Return an image of arbitrary opaque pixels, (size, size, 4) float32."""
    pixels = np.ones((size, size, 4), np.float32)
    pixels[..., :3] = np.random.default_rng(seed).uniform(0.1, 0.9, (size, size, 3))
    return pixels


def link_image(surface: bpy.types.Material, image: bpy.types.Image, socket: str, output: str = "Color"):
    """Link an image texture to an input of the Principled BSDF; return the texture node."""
    tree = surface.node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    tree.links.new(node.outputs[output], principled(surface).inputs[socket])
    return node


def smooth(obj: bpy.types.Object) -> bpy.types.Object:
    """Shade an object smooth."""
    obj.data.polygons.foreach_set("use_smooth", [True] * len(obj.data.polygons))
    return obj


def _tree(datablock: bpy.types.Material | bpy.types.World) -> bpy.types.NodeTree:
    """Return the nodes of a new datablock, which Blender before 5.0 does not make by itself."""
    if datablock.node_tree is None:
        datablock.use_nodes = True
    return datablock.node_tree
