"""Material nodes -> reflectance, emission and alpha, where they are constants or plain textures."""

from __future__ import annotations

import bpy
import numpy as np

from ....engine.scene.color import luminance
from ....engine.scene.model import Material
from ....engine.scene.transmission import from_opacity, uniform_transmission
from ...compat import node_input, node_tree
from .bumps import bump_factor
from .object_nodes import Source, shown, source_of
from .pixels import PixelCache
from .sockets import ComplexError, feeder
from .textures import read_texture
from .values import BLACK, HOLE, ONE, ZERO, Surface, Value, constant

#: What Cycles shows where there is no material.
_DEFAULT_GREY = np.full(3, 0.8, np.float32)

_CONSTANT_NODES = {"RGBA": "ShaderNodeRGB", "VALUE": "ShaderNodeValue"}


class ShaderReader:
    """Reads the shader of one material, world or light.

    owner  how messages name the datablock
    notes  sentences for the user are appended here, each once
    cache  images; without one every texture is ComplexError
    values  what nodes tell of the object that shows the material
    """

    def __init__(
        self,
        owner: str,
        notes: list[str],
        cache: PixelCache | None = None,
        values: dict[Source, tuple[float, ...]] | None = None,
    ) -> None:
        self._owner, self._notes, self._cache, self._values = owner, notes, cache, values or {}

    def surface(self, socket: bpy.types.NodeSocket) -> Surface:
        """Return what the shader linked to a socket does; raises ComplexError if only Blender knows."""
        output = feeder(socket)
        if not output.is_output:
            return BLACK
        read = _SHADERS.get(output.node.bl_idname)
        if read is None:
            raise ComplexError
        return read(self, output.node)

    def colour(self, node: bpy.types.Node, *names: str) -> Value:
        """Return a colour input of a node, black if the node has none of that name."""
        socket = node_input(node, *names)
        return ZERO if socket is None else self._value(socket, 3)

    def number(self, node: bpy.types.Node, *names: str) -> Value:
        """Return a number input of a node as a grey, 0 if the node has none of that name."""
        socket = node_input(node, *names)
        return ZERO if socket is None else self._value(socket, 1)

    def reflectance(self, node: bpy.types.Node, *names: str) -> Value:
        """Return a colour input of a node as what its surface reflects, with the bumps that it has."""
        colour = self.colour(node, *names)
        return colour if colour.is_zero else colour * bump_factor(node, self._cache, self._owner)

    def alpha(self, socket: bpy.types.NodeSocket) -> tuple[Value, float | None]:
        """Return an input that may be cut at a threshold by a Math node, and the threshold."""
        output = feeder(socket)
        if output.is_output and output.node.bl_idname == "ShaderNodeMath":
            node = output.node
            if node.operation == "ROUND":
                return self._value(node.inputs[0], 1), 0.5
            if node.operation in {"GREATER_THAN", "LESS_THAN"}:
                first, second = node.inputs[:2]
                image, limit = (first, second) if node.operation == "GREATER_THAN" else (second, first)
                return self._value(image, 1), self._value(limit, 1).number
        return self._value(socket, 1), None

    def _value(self, socket: bpy.types.NodeSocket, channels: int) -> Value:
        """Return what an input holds, or what is linked to it."""
        output = feeder(socket)
        node = output.node
        if not output.is_output or node.bl_idname == _CONSTANT_NODES.get(output.type):
            return _fitting(_constant(output), output, channels)
        source = source_of(output)
        if source in self._values:
            return _fitting(constant(*shown(output, self._values[source])), output, channels)
        if node.bl_idname == "ShaderNodeValToRGB":
            return self._ramp(output, channels)
        if node.bl_idname == "ShaderNodeTexImage" and self._cache is not None:
            return Value(np.ones(3), read_texture(output, self._cache, self._owner, channels))
        if node.bl_idname in {"ShaderNodeMix", "ShaderNodeMixRGB"}:
            return self._product(node, channels)
        raise ComplexError

    def _ramp(self, output: bpy.types.NodeSocket, channels: int) -> Value:
        """Return the colour, or alpha, of a Color Ramp at a constant factor."""
        colour = output.node.color_ramp.evaluate(self._value(output.node.inputs["Fac"], 1).number)
        value = constant(colour[3]) if output.name == "Alpha" else constant(*colour[:3])
        return _fitting(value, output, channels)

    def _product(self, node: bpy.types.Node, channels: int) -> Value:
        """Return what a Mix node that multiplies colours at full strength makes."""
        mixes = node.bl_idname == "ShaderNodeMix"
        if node.blend_type != "MULTIPLY" or (mixes and node.data_type != "RGBA"):
            raise ComplexError
        inputs = [socket for socket in node.inputs if socket.enabled]
        if len(inputs) != 3 or self._value(inputs[0], 1).number != 1:
            raise ComplexError
        return self._value(inputs[1], channels) * self._value(inputs[2], channels)


def _constant(socket: bpy.types.NodeSocket) -> Value:
    """Return the own value of a socket."""
    value = getattr(socket, "default_value", 0.0)
    return constant(*list(value)[:3]) if hasattr(value, "__len__") else constant(value)


def _fitting(value: Value, output: bpy.types.NodeSocket, channels: int) -> Value:
    """Return what a socket takes of a constant: a number the luminance of a colour, the mean of a vector."""
    if channels == 3 or output.type not in {"RGBA", "VECTOR"}:
        return value
    grey = luminance(value.constant) if output.type == "RGBA" else value.constant.mean()
    return constant(float(grey))


def _rest(value: Value) -> Value:
    """Return 1 minus a constant."""
    return constant(1 - value.number)


def _principled(reader: ShaderReader, node: bpy.types.Node) -> Surface:
    """Diffuse part of the Principled BSDF: what metal reflects or glass lets through is not diffuse."""
    diffuse = _rest(reader.number(node, "Metallic"))
    diffuse = diffuse * _rest(reader.number(node, "Transmission Weight", "Transmission"))
    emission = reader.colour(node, "Emission Color", "Emission")
    strength = reader.number(node, "Emission Strength")
    reflectance = ZERO if diffuse.is_zero else reader.reflectance(node, "Base Color") * diffuse
    alpha, threshold = reader.alpha(node.inputs["Alpha"])
    return Surface(reflectance, ZERO if strength.is_zero else emission * strength, alpha, threshold)


def _diffuse(reader: ShaderReader, node: bpy.types.Node) -> Surface:
    return Surface(reader.reflectance(node, "Color"), ZERO, ONE)


def _emission(reader: ShaderReader, node: bpy.types.Node) -> Surface:
    """Emission and Background: colour times strength, no reflection."""
    return Surface(ZERO, reader.colour(node, "Color") * reader.number(node, "Strength"), ONE)


def _transparent(reader: ShaderReader, node: bpy.types.Node) -> Surface:
    """White lets everything through; of coloured glass only Blender knows."""
    if (reader.colour(node, "Color") + constant(-1.0)).constant.any():
        raise ComplexError
    return HOLE


def _no_diffuse(reader: ShaderReader, node: bpy.types.Node) -> Surface:
    """What is shiny or clear stops light, and reflects none of it diffusely."""
    return BLACK


def _add(reader: ShaderReader, node: bpy.types.Node) -> Surface:
    first, second = (reader.surface(socket) for socket in node.inputs[:2])
    if first.alpha.texture or second.alpha.texture or (first.alpha.number, second.alpha.number) != (1, 1):
        raise ComplexError
    return Surface(first.reflectance + second.reflectance, first.emission + second.emission, ONE)


def _mix(reader: ShaderReader, node: bpy.types.Node) -> Surface:
    """Mix two shaders; one of them may be a hole, which the factor then cuts."""
    first, second = (reader.surface(socket) for socket in node.inputs[1:3])
    factor, threshold = reader.alpha(node.inputs[0])
    if first.is_hole and second.threshold is None:
        return Surface(second.reflectance, second.emission, second.alpha * factor, threshold)
    mix = min(max(factor.number, 0.0), 1.0)
    if second.is_hole and first.threshold is None:
        return Surface(first.reflectance, first.emission, first.alpha * (1 - mix))
    if mix in (0.0, 1.0):
        return second if mix else first
    if first.alpha.number * second.alpha.number != 1:
        raise ComplexError
    return Surface(
        first.reflectance * (1 - mix) + second.reflectance * mix,
        first.emission * (1 - mix) + second.emission * mix,
        ONE,
    )


_SHADERS = {
    "ShaderNodeBsdfPrincipled": _principled,
    "ShaderNodeBsdfDiffuse": _diffuse,
    "ShaderNodeEmission": _emission,
    "ShaderNodeBackground": _emission,
    "ShaderNodeBsdfTransparent": _transparent,
    "ShaderNodeBsdfGlossy": _no_diffuse,
    "ShaderNodeBsdfAnisotropic": _no_diffuse,
    "ShaderNodeBsdfGlass": _no_diffuse,
    "ShaderNodeBsdfRefraction": _no_diffuse,
    "ShaderNodeAddShader": _add,
    "ShaderNodeMixShader": _mix,
}


def read_material(
    material: bpy.types.Material | None,
    notes: list[str],
    cache: PixelCache,
    values: dict[Source, tuple[float, ...]] | None = None,
) -> Material:
    """Return the diffuse surface of a material; an empty slot is Cycles' grey.

    values: of nodes that tell of the object, see `object_nodes.object_values`.

    Sentences about what could not be taken over are appended to `notes`. Raises ComplexError if only Blender
    can evaluate it.
    """
    if material is None:
        return Material("(no material)", _DEFAULT_GREY, np.zeros(3, np.float32))
    tree = node_tree(material)
    if tree is None:
        colour = np.array(material.diffuse_color, np.float32)[:3]
        return Material(material.name, np.clip(colour, 0, 1), np.zeros(3, np.float32))
    output = tree.get_output_node("CYCLES")
    reader = ShaderReader(f"Material '{material.name}'", notes, cache, values)
    surface = reader.surface(output.inputs["Surface"]) if output else BLACK
    return to_material(material.name, surface)


def to_material(name: str, surface: Surface) -> Material:
    """Return a surface as the engine's material."""
    alpha = float(np.clip(surface.alpha.constant[0], 0, 1))
    return Material(
        name,
        np.clip(surface.reflectance.constant, 0, 1).astype(np.float32),
        np.maximum(surface.emission.constant, 0).astype(np.float32),
        reflectance_map=surface.reflectance.texture,
        emission_map=surface.emission.texture,
        transmission=uniform_transmission(from_opacity(alpha, surface.alpha.texture, surface.threshold)),
    )
