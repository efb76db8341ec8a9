"""Scenes lit by their world, and by surfaces that emit."""

from __future__ import annotations

import math

import bpy
import numpy as np

from .stage import add, floor, glow, link_image, material, patchwork, picture, plane, stage, world, world_image


def world_constant() -> None:
    stage()
    world()


def world_hdri() -> None:
    """An image with a small sun, turned by a Mapping node."""
    stage()
    tree, node = world_image(picture("Sky", _sky_pixels(), "Linear Rec.709", True), 0.8)
    mapping, place = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
    mapping.inputs["Rotation"].default_value = (0.1, 0.2, 1.0)
    tree.links.new(place.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], node.inputs["Vector"])


def world_hdri_soft() -> None:
    """An image without a sun: the hemicubes see all of it."""
    stage()
    pixels = _sky_pixels()
    world_image(picture("Sky", np.minimum(pixels, 1), "Linear Rec.709", True))


def world_gradient() -> None:
    """Nodes that only Blender evaluates."""
    stage()
    tree = world()
    gradient, place = tree.nodes.new("ShaderNodeTexGradient"), tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(place.outputs["Generated"], gradient.inputs["Vector"])
    tree.links.new(gradient.outputs["Color"], tree.nodes["Background"].inputs["Color"])


def world_sky() -> None:
    """A Sky Texture with its sun."""
    stage()
    tree = world(0.1)
    sky = tree.nodes.new("ShaderNodeTexSky")
    if hasattr(sky, "sun_elevation"):
        sky.sun_elevation, sky.sun_rotation, sky.sun_size = math.radians(40), 0.7, math.radians(3)
    tree.links.new(sky.outputs["Color"], tree.nodes["Background"].inputs["Color"])


def _sky_pixels() -> np.ndarray:
    """Return an equirectangular image with a bright spot, (64, 128, 4) float32."""
    pixels = np.ones((64, 128, 4), np.float32)
    v, u = np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(128) + 0.5) / 128, indexing="ij")
    pixels[..., 0], pixels[..., 2] = 0.2 + 0.6 * v, 0.2 + 0.8 * v
    pixels[..., 1] = 0.4 + 0.3 * np.cos(2 * np.pi * u)
    pixels[44:47, 20:24, :3] = 150
    return pixels


def emission_small() -> None:
    """A small bright quad, which is sampled as a light; both its sides emit."""
    stage()
    quad = plane("Quad", glow(40), 0.3, location=(-0.5, 0.3, 1.2), rotation_euler=(0.4, math.pi, 0))
    quad.hemibake.role = "OCCLUDER"


def emission_large() -> None:
    """A large dim ceiling, which the hemicubes see."""
    stage()
    plane("Ceiling", glow(1), 6, location=(0, 0, 2)).hemibake.role = "OCCLUDER"


def emission_textured() -> None:
    """A screen that is baked itself."""
    stage()
    surface = glow(20)
    link_image(surface, picture("Screen", patchwork(4, 7)), "Emission Color")
    plane("Screen", surface, 0.5, location=(-0.5, 0.3, 1.2), rotation_euler=(0.4, math.pi, 0))


def emission_of_sphere() -> None:
    """A bright ball of many triangles."""
    floor()
    ball = add("Ball", bpy.ops.mesh.primitive_ico_sphere_add, glow(30), subdivisions=3, radius=0.15,
               location=(-0.5, 0.3, 0.8))  # fmt: skip
    ball.hemibake.role = "OCCLUDER"
    plane("Wall", material("Wall", (0.3, 0.7, 0.4)), 1, location=(0.8, 0, 0.52), rotation_euler=(0, -math.pi / 2, 0))


SCENES = (
    world_constant, world_hdri, world_hdri_soft, world_gradient, world_sky,
    emission_small, emission_large, emission_textured, emission_of_sphere,
)  # fmt: skip
