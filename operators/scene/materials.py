"""Material nodes -> constant reflectance and emission."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ...engine.scene import Material
from ..compat import node_input, node_tree

#: What Cycles shows where there is no material.
_DEFAULT_GREY = np.full(3, 0.8, np.float32)


@dataclass(frozen=True)
class Surface:
    """Reflectance and emitted radiance of a shader, (3,) float32 each."""

    reflectance: np.ndarray
    emission: np.ndarray


_BLACK = Surface(np.zeros(3, np.float32), np.zeros(3, np.float32))


class ShaderReader:
    """Reads the shader of one material or world as constants.

    owner  how messages name the datablock
    notes  sentences for the user are appended here, each once
    """

    def __init__(self, owner: str, notes: list[str]) -> None:
        self._owner = owner
        self._notes = notes

    def surface(self, socket: bpy.types.NodeSocket) -> Surface:
        """Return what the shader linked to a socket reflects and emits."""
        feeder = _feeder(socket)
        if not feeder.is_output:
            return _BLACK
        node = feeder.node
        read = _SHADERS.get(node.bl_idname)
        if read is None:
            self._note(f"uses the node '{node.bl_label}', which is not baked: taken as black")
            return _BLACK
        return read(self, node)

    def colour(self, node: bpy.types.Node, *names: str) -> np.ndarray:
        """Return a colour input of a node, (3,) float32, scene-linear."""
        return np.array(self._constant(node, names, (0.0, 0.0, 0.0, 1.0)), np.float32)[:3]

    def value(self, node: bpy.types.Node, *names: str) -> float:
        """Return a number input of a node, 0 if the node has none of that name."""
        return float(self._constant(node, names, 0.0))

    def _constant(self, node: bpy.types.Node, names: tuple[str, ...], missing):
        socket = node_input(node, *names)
        if socket is None:
            return missing
        feeder = _feeder(socket)
        constant = not feeder.is_output or feeder.node.bl_idname == _CONSTANT_NODES.get(socket.type)
        if constant and feeder.type == socket.type:
            return feeder.default_value
        self._note(f"has a node linked to '{socket.name}': the socket's own value is baked instead")
        return socket.default_value

    def _note(self, text: str) -> None:
        note = f"{self._owner} {text}."
        if note not in self._notes:
            self._notes.append(note)


_CONSTANT_NODES = {"RGBA": "ShaderNodeRGB", "VALUE": "ShaderNodeValue"}


def _feeder(socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """Return the output that feeds an input, through reroutes and muted nodes.

    Where nothing feeds it, return the input whose own value counts: a muted node passes the input that
    Blender links to the output internally, or nothing at all.
    """
    own = socket
    while socket.is_linked and not socket.links[0].is_muted:
        output = socket.links[0].from_socket
        if output.node.bl_idname == "NodeReroute":
            socket = output.node.inputs[0]
        elif output.node.mute:
            passed = next((link for link in output.node.internal_links if link.to_socket == output), None)
            if passed is None:
                break
            own = socket = passed.from_socket
        else:
            return output
    return own


def _principled(reader: ShaderReader, node: bpy.types.Node) -> Surface:
    """Diffuse part of the Principled BSDF: what metal reflects or glass lets through is not diffuse."""
    diffuse = (1 - reader.value(node, "Metallic")) * (
        1 - reader.value(node, "Transmission Weight", "Transmission")
    )
    emission = reader.colour(node, "Emission Color", "Emission") * reader.value(node, "Emission Strength")
    return Surface(reader.colour(node, "Base Color") * np.float32(diffuse), emission)


def _diffuse(reader: ShaderReader, node: bpy.types.Node) -> Surface:
    return Surface(reader.colour(node, "Color"), _BLACK.emission)


def _emission(reader: ShaderReader, node: bpy.types.Node) -> Surface:
    """Emission and Background: colour times strength, no reflection."""
    return Surface(_BLACK.reflectance, reader.colour(node, "Color") * reader.value(node, "Strength"))


def _add(reader: ShaderReader, node: bpy.types.Node) -> Surface:
    first, second = (reader.surface(socket) for socket in node.inputs[:2])
    return Surface(first.reflectance + second.reflectance, first.emission + second.emission)


def _mix(reader: ShaderReader, node: bpy.types.Node) -> Surface:
    fraction = np.float32(min(max(reader.value(node, "Fac", "Factor"), 0.0), 1.0))
    first, second = (reader.surface(socket) for socket in node.inputs[1:3])
    return Surface(
        (1 - fraction) * first.reflectance + fraction * second.reflectance,
        (1 - fraction) * first.emission + fraction * second.emission,
    )


_SHADERS = {
    "ShaderNodeBsdfPrincipled": _principled,
    "ShaderNodeBsdfDiffuse": _diffuse,
    "ShaderNodeEmission": _emission,
    "ShaderNodeBackground": _emission,
    "ShaderNodeAddShader": _add,
    "ShaderNodeMixShader": _mix,
}


def read_material(material: bpy.types.Material | None, notes: list[str]) -> Material:
    """Return the constant diffuse surface of a material; an empty slot is Cycles' grey.

    Sentences about what could not be taken over are appended to `notes`.
    """
    if material is None:
        return Material("(no material)", _DEFAULT_GREY, np.zeros(3, np.float32))
    tree = node_tree(material)
    if tree is None:
        colour = np.array(material.diffuse_color, np.float32)[:3]
        return Material(material.name, np.clip(colour, 0, 1), np.zeros(3, np.float32))
    output = tree.get_output_node("CYCLES")
    reader = ShaderReader(f"Material '{material.name}'", notes)
    surface = reader.surface(output.inputs["Surface"]) if output else _BLACK
    return Material(
        material.name,
        np.clip(surface.reflectance, 0, 1).astype(np.float32),
        np.maximum(surface.emission, 0).astype(np.float32),
    )
