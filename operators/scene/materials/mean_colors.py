"""Mean colours for materials that can neither be read nor evaluated by Cycles."""

from __future__ import annotations

import bpy
import numpy as np

from ....engine.scene.color import srgb_to_linear
from ....engine.scene.model import Material
from ...compat import node_tree
from .closures import ADD, MIX
from .engine_materials import Sides, to_material
from .materials import ShaderReader
from .pixels import PixelCache
from .sockets import ComplexError, feeding_socket
from .values import DiffuseSurface, MaterialValue, constant

#: Reflectance of closures that cannot be read, the same as for an empty slot.
_GREY = 0.8


class _MeanReader(ShaderReader):
    """A reader that uses the mean of images, and the unlinked value of inputs that nodes compute."""

    def _surface_of(self, socket: bpy.types.NodeSocket) -> DiffuseSurface:
        """Return the surface of the shader linked to a socket; grey if it cannot be read."""
        try:
            return super()._surface_of(socket)
        except ComplexError:
            return self._mean_surface(feeding_socket(socket).node)

    def _mean_surface(self, node: bpy.types.Node) -> DiffuseSurface:
        """Return the sum or equal mix of a node's shaders; grey for nodes other than Mix and Add Shader."""
        inputs = {MIX: node.inputs[1:3], ADD: node.inputs[:2]}.get(node.bl_idname)
        if inputs is None:
            return DiffuseSurface(reflect=constant(_GREY))
        first, second = (self.surface(socket).solid() for socket in inputs)
        part = 0.5 if node.bl_idname == MIX else 1.0
        return first.scaled(part) + second.scaled(part)

    def _value_of(self, socket: bpy.types.NodeSocket, channels: int) -> MaterialValue:
        try:
            value = super()._value_of(socket, channels)
        except ComplexError:
            own = socket.default_value
            return constant(*list(own)[:3]) if hasattr(own, "__len__") else constant(own)
        if value.texture is None:
            return value
        pixels = value.texture.pixels
        linear = srgb_to_linear(pixels) if value.texture.srgb else pixels
        mean = linear.mean(axis=(0, 1), dtype=np.float64)
        return MaterialValue(value.constant * mean)


def mean_color(material: bpy.types.Material, notes: list[str], cache: PixelCache, glass: bool) -> Material:
    """Approximate a material by constants and the means of its images, without textures.

    Raises PixelsNeededError if an image must be read first.
    """
    reader = _MeanReader(f"Material '{material.name}'", notes, cache, glass=glass)
    tree = node_tree(material)
    assert tree is not None
    output = tree.get_output_node("CYCLES")
    return to_material(material.name, Sides(reader.surface(output.inputs["Surface"])))
