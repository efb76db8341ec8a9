"""Converts image texture nodes to engine textures."""

from __future__ import annotations

import bpy
import numpy as np

from ....engine.scene.texture import Texture
from .pixels import PixelCache, is_plain, is_srgb
from .sockets import ComplexError, feeding_socket

_EXTENSIONS = {"REPEAT": "repeat", "EXTEND": "extend", "CLIP": "clip", "MIRROR": "mirror"}


def read_texture(output: bpy.types.NodeSocket, cache: PixelCache, owner: str, channels: int) -> Texture:
    """Return the texture of an image node's output: 3 channels of colour, or 1 of alpha or grey.

    Raises ComplexError for nodes that only Cycles can evaluate.
    """
    node = output.node
    if node.projection != "FLAT" or node.interpolation == "Smart" or not is_plain(node.image):
        raise ComplexError
    uv_map, transform = _mapping(node.inputs["Vector"])
    part = "alpha" if output.name == "Alpha" else "grey" if channels == 1 else "colour"
    if part != "alpha" and not node.outputs["Alpha"].is_linked:
        part += " * alpha"
    pixels = cache.read_part(node.image, owner, part)
    name = node.image.name if node.image else "(no image)"
    smooth = node.interpolation != "Closest"
    return Texture(
        name=name,
        pixels=pixels,
        uv_map=uv_map,
        transform=transform,
        extension=_EXTENSIONS[node.extension],
        smooth=smooth,
        srgb=part.startswith("colour") and is_srgb(node.image),
    )


def _mapping(socket: bpy.types.NodeSocket) -> tuple[str, np.ndarray]:
    """Return the UV map of a vector input ("" for the one active for rendering) and its (2, 3) transform."""
    output = feeding_socket(socket)
    if not output.is_output:
        return "", np.eye(2, 3)
    node = output.node
    if node.bl_idname == "ShaderNodeUVMap" and not node.from_instancer:
        return node.uv_map, np.eye(2, 3)
    if node.bl_idname == "ShaderNodeTexCoord" and output.name == "UV" and not node.from_instancer:
        return "", np.eye(2, 3)
    if node.bl_idname == "ShaderNodeMapping" and node.vector_type in {"POINT", "TEXTURE"}:
        uv_map, inner = _mapping(node.inputs["Vector"])
        return uv_map, _combine(_node_matrix(node), inner)
    raise ComplexError


def _node_matrix(node: bpy.types.Node) -> np.ndarray:
    """Return the (2, 3) transform of a Mapping node that rotates about z; raises ComplexError for others."""
    names = ("Location", "Rotation", "Scale")
    if any(feeding_socket(node.inputs[name]).is_output for name in names):
        raise ComplexError
    location, turn, scale = (np.array(node.inputs[name].default_value, np.float64) for name in names)
    if abs(turn[0]) > 1e-6 or abs(turn[1]) > 1e-6:
        raise ComplexError
    rotation = np.array([[np.cos(turn[2]), -np.sin(turn[2])], [np.sin(turn[2]), np.cos(turn[2])]])
    matrix = np.eye(3)
    matrix[:2, :2] = rotation * scale[:2]
    matrix[:2, 2] = location[:2]
    if node.vector_type == "TEXTURE":
        if np.prod(scale[:2]) == 0:
            raise ComplexError
        matrix = np.linalg.inv(matrix)
    return matrix[:2]


def _combine(outer: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """Return the product of two (2, 3) affine transforms; the inner one is applied first."""
    return outer @ np.concatenate([inner, [[0, 0, 1]]])
