"""Normal maps as a factor of reflectance: light that a bumpy surface reflects compared to a flat one."""

from __future__ import annotations

import bpy

from ....engine.scene.bump_reflectance import reflected_by_bumps
from .normal_map_tilts import heights_of
from .pixels import PixelCache, is_plain
from .sockets import feeding_socket


def bump_factor(shader: bpy.types.Node, cache: PixelCache | None, owner: str) -> float:
    """Return the mean of `reflected_by_bumps` over the normal map of a shader; 1 without one.

    Only Normal Map nodes in tangent space with a plain image are read; other bumps count as flat. Raises
    PixelsNeededError if the image must be read first.

    owner:  name of the datablock in messages
    """
    normal = feeding_socket(shader.inputs["Normal"]) if "Normal" in shader.inputs else None
    if cache is None or normal is None or not normal.is_output:
        return 1.0
    node = normal.node
    if node.bl_idname != "ShaderNodeNormalMap" or node.space != "TANGENT":
        return 1.0
    colour, strength = feeding_socket(node.inputs["Color"]), feeding_socket(node.inputs["Strength"])
    if not colour.is_output or colour.node.bl_idname != "ShaderNodeTexImage" or strength.is_output:
        return 1.0
    image = colour.node.image
    if image is None or not is_plain(image) or strength.default_value <= 0:
        return 1.0
    counts = cache.read_tilts(image, owner)
    reflected = reflected_by_bumps(heights_of(strength.default_value))
    return float(counts @ reflected / counts.sum())


def surface_bumps(material: bpy.types.Material, cache: PixelCache) -> float:
    """Return `bump_factor` of the shader linked to the material's output; 1 if shaders are mixed.

    Raises PixelsNeededError if an image must be read first.
    """
    output = material.node_tree.get_output_node("CYCLES")
    shader = None if output is None else feeding_socket(output.inputs["Surface"])
    if shader is None or not shader.is_output:
        return 1.0
    return bump_factor(shader.node, cache, f"Material '{material.name}'")
