"""World nodes -> radiance of the surroundings."""

from __future__ import annotations

import bpy
import numpy as np

from ....engine.direct.sky import shrink_sky
from ....engine.scene.color import srgb_to_linear
from ...compat import node_input, node_tree
from ..materials.materials import ShaderReader
from ..materials.pixels import PixelCache, is_plain, is_srgb
from ..materials.sockets import ComplexError, feeder
from .panorama import render_world

#: Largest map of the surroundings, rows.
_ROWS = 1024


def read_world(world: bpy.types.World | None, notes: list[str]) -> np.ndarray:
    """Return the radiance of a world, (3,) or equirectangular (h, w, 3) float32 as engine.Scene.world.

    A constant colour and an equirectangular image are read as they are; anything else is rendered by
    Blender. Sentences about what could not be taken over are appended to `notes`.
    """
    if world is None:
        return np.zeros(3, np.float32)
    tree = node_tree(world)
    if tree is None:
        return np.array(world.color, np.float32)[:3]
    output = tree.get_output_node("CYCLES")
    if output is None:
        return np.zeros(3, np.float32)
    try:
        return _background(world, output, notes)
    except ComplexError:
        return _rendered(world, notes)


def _rendered(world: bpy.types.World, notes: list[str]) -> np.ndarray:
    """Return what Blender makes of a world, black if it cannot."""
    try:
        return np.maximum(render_world(world), 0)
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[-1]
        notes.append(f"Blender could not render the world '{world.name}' ({reason}): it is baked black.")
        return np.zeros(3, np.float32)


def _background(world: bpy.types.World, output: bpy.types.Node, notes: list[str]) -> np.ndarray:
    """Return a Background shader's colour or image times its strength, else raise ComplexError."""
    owner = f"World '{world.name}'"
    shader = feeder(output.inputs["Surface"])
    reader = ShaderReader(owner, notes)
    if shader.is_output and shader.node.bl_idname == "ShaderNodeBackground":
        colour = feeder(node_input(shader.node, "Color"))
        if colour.is_output and colour.node.bl_idname == "ShaderNodeTexEnvironment":
            strength = reader.number(shader.node, "Strength").number
            return _environment(colour.node, owner, notes) * np.float32(max(strength, 0.0))
    emission = reader.surface(output.inputs["Surface"]).emission
    return np.maximum(emission.constant, 0).astype(np.float32)


def _environment(node: bpy.types.Node, owner: str, notes: list[str]) -> np.ndarray:
    """Return an environment texture, turned by its Mapping node, (h, w, 3) float32."""
    if node.projection != "EQUIRECTANGULAR" or not is_plain(node.image):
        raise ComplexError
    matrix = _rotation(node.inputs["Vector"])
    pixels = np.maximum(PixelCache(notes).read(node.image, owner)[..., :3], 0)
    pixels = srgb_to_linear(pixels) if is_srgb(node.image) else pixels
    pixels = _shrunk(pixels)
    return pixels if matrix is None else _turned(pixels, matrix)


def _rotation(socket: bpy.types.NodeSocket) -> np.ndarray | None:
    """Return the (3, 3) matrix that a Mapping node applies to directions, None for none."""
    output = feeder(socket)
    if not output.is_output:
        return None
    node = output.node
    if node.bl_idname == "ShaderNodeTexCoord" and output.name == "Generated":
        return None
    if node.bl_idname != "ShaderNodeMapping" or node.vector_type not in {"POINT", "VECTOR"}:
        raise ComplexError
    names = ("Location", "Rotation", "Scale")
    if any(feeder(node.inputs[name]).is_output for name in names):
        raise ComplexError
    if node.vector_type == "POINT" and any(
        abs(value) > 1e-6 for value in node.inputs["Location"].default_value
    ):
        raise ComplexError
    inner = _rotation(node.inputs["Vector"])
    turn = np.array(node.inputs["Rotation"].default_value.to_matrix(), np.float64)
    matrix = turn @ np.diag(np.array(node.inputs["Scale"].default_value, np.float64))
    return matrix if inner is None else matrix @ inner


def _shrunk(pixels: np.ndarray) -> np.ndarray:
    """Return an image with at most _ROWS rows and pixels of the same shape."""
    height, width = pixels.shape[:2]
    if height <= _ROWS:
        return pixels
    return shrink_sky(pixels, _ROWS, max(1, round(width * _ROWS / height)))


def _turned(pixels: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return a map that shows in each direction what the image shows in the turned direction."""
    height, width = pixels.shape[:2]
    phi = 2 * np.pi * (0.5 - (np.arange(width) + 0.5) / width)
    theta = np.pi * (1 - (np.arange(height) + 0.5) / height)[:, None]
    x, y = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)
    directions = np.stack([x, y, np.broadcast_to(np.cos(theta), x.shape)], axis=2) @ matrix.T
    length = np.maximum(np.linalg.norm(directions, axis=2), 1e-30)
    u = 0.5 - np.arctan2(directions[..., 1], directions[..., 0]) / (2 * np.pi)
    v = 1 - np.arccos(np.clip(directions[..., 2] / length, -1, 1)) / np.pi
    return _interpolated(pixels, u * width - 0.5, v * height - 0.5)


def _interpolated(pixels: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return pixels at points counted from pixel centres; columns go around."""
    height, width = pixels.shape[:2]
    left, below = np.floor(x).astype(int), np.floor(y).astype(int)
    across, up = (x - left)[..., None].astype(np.float32), (y - below)[..., None].astype(np.float32)
    low, high = np.clip(below, 0, height - 1), np.clip(below + 1, 0, height - 1)
    first = pixels[low, left % width] * (1 - across) + pixels[low, (left + 1) % width] * across
    second = pixels[high, left % width] * (1 - across) + pixels[high, (left + 1) % width] * across
    return (first * (1 - up) + second * up).astype(np.float32)
