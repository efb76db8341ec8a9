"""Reads light nodes as factors of the light's power: colour, profile by direction, falloff by distance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ....engine.errors import SceneError
from ....engine.scene.profile import Profile, read_ies
from ...compat import blackbody
from ...working_space import luminance_of
from ..materials.chains import inputs_first
from ..materials.sockets import ComplexError, feeding_socket

#: Strength that Cycles uses for an IES file that it cannot read (kernel/util/ies.h).
_MISSING_IES = 100.0

#: Nodes whose outputs are proportional to an input called Strength.
_STRENGTHS = frozenset({"ShaderNodeLightFalloff", "ShaderNodeTexIES"})

_FALLOFF_POWERS = {"Quadratic": 0, "Linear": 1, "Constant": 2}


@dataclass(frozen=True)
class LightNodes:
    """Factors of a light's power.

    colour:   (3,) float64 RGB
    profile:  factor over directions; None for 1 in all directions
    falloff:  power of the distance and smoothing of a Light Falloff node, see engine.Light; None without one
    """

    colour: np.ndarray = field(default_factory=lambda: np.ones(3))
    profile: Profile | None = None
    falloff: tuple[int, float] | None = None

    def __mul__(self, other: LightNodes) -> LightNodes:
        """Multiply the factors; raises ComplexError for two profiles or two falloffs."""
        if (self.profile and other.profile) or (self.falloff and other.falloff):
            raise ComplexError
        profile, falloff = self.profile or other.profile, self.falloff or other.falloff
        return LightNodes(self.colour * other.colour, profile, falloff)

    def grey(self) -> LightNodes:
        """Return the factors with the colour replaced by its luminance, as number inputs convert colours."""
        grey = np.full(3, luminance_of(self.colour)) if np.ptp(self.colour) else self.colour
        return LightNodes(grey, self.profile, self.falloff)


#: Factors of inputs by the address of the socket.
_Known = dict[int, LightNodes]


class LightNodeReader:
    """Reads the nodes of lights if they can be represented exactly.

    notes:  sentences for the user are appended here
    """

    def __init__(self, notes: list[str]) -> None:
        self._notes = notes
        self._profiles: dict[str, Profile] = {}

    def read(self, tree: bpy.types.NodeTree, name: str) -> LightNodes:
        """Return the factors of a light's nodes; raises ComplexError if only Cycles can evaluate them."""
        output = tree.get_output_node("CYCLES")
        shader = feeding_socket(output.inputs["Surface"]) if output else None
        if shader is None or not shader.is_output:
            return LightNodes(np.zeros(3))
        if shader.node.bl_idname != "ShaderNodeEmission":
            raise ComplexError
        colour, strength = (shader.node.inputs[socket] for socket in ("Color", "Strength"))
        return self._value(colour, name) * self._value(strength, name).grey()

    def _value(self, socket: bpy.types.NodeSocket, name: str) -> LightNodes:
        """Return the factors of an input: its own value, or the output of the node linked to it."""
        known: _Known = {}
        for each in inputs_first(socket, _multiplied, bpy.types.NodeSocket.as_pointer):
            known[each.as_pointer()] = LightNodes(np.zeros(3))
            known[each.as_pointer()] = self._value_of(each, name, known)
        return known[socket.as_pointer()]

    def _value_of(self, socket: bpy.types.NodeSocket, name: str, known: _Known) -> LightNodes:
        """Return the factors of an input.

        known:  factors of the inputs of its node that `_multiplied` returns
        """
        output = feeding_socket(socket)
        node = output.node
        if not output.is_output or node.bl_idname in {"ShaderNodeRGB", "ShaderNodeValue"}:
            return _constant(output)
        if node.bl_idname == "ShaderNodeBlackbody":
            return LightNodes(_blackbody(node))
        if node.bl_idname == "ShaderNodeLightFalloff":
            return _falloff(output) * _of(node.inputs["Strength"], known)
        if node.bl_idname == "ShaderNodeTexIES":
            return self._ies(node, name) * _of(node.inputs["Strength"], known)
        if _is_product(node):
            first, second = (_of(factor, known) for factor in node.inputs[:2])
            return first * second
        raise ComplexError

    def _ies(self, node: bpy.types.Node, name: str) -> LightNodes:
        """Return an IES Texture node's factors for strength 1; raises ComplexError for a linked Vector."""
        if feeding_socket(node.inputs["Vector"]).is_output:
            raise ComplexError
        try:
            return LightNodes(profile=self._profile(node))
        except (SceneError, OSError) as error:
            self._notes.append(
                f"The IES file of light '{name}' cannot be read ({error}): the strength {_MISSING_IES:g} is "
                "baked, as in Cycles. Choose another file in its IES Texture node."
            )
            return LightNodes(np.full(3, _MISSING_IES))

    def _profile(self, node: bpy.types.Node) -> Profile:
        """Return the profile of an IES Texture node, parsed once per text; raises SceneError or OSError."""
        if node.mode == "EXTERNAL":
            path = bpy.path.abspath(node.filepath, library=node.id_data.library)
            text = Path(path).read_text(encoding="latin-1")
        elif node.ies is None:
            raise SceneError("none is chosen")
        else:
            text = node.ies.as_string()
        if text not in self._profiles:
            self._profiles[text] = read_ies(text)
        return self._profiles[text]


def _multiplied(socket: bpy.types.NodeSocket) -> Sequence[bpy.types.NodeSocket]:
    """Return the inputs that the node linked to an input multiplies its output by."""
    output = feeding_socket(socket)
    if output.is_output and output.node.bl_idname in _STRENGTHS:
        return [output.node.inputs["Strength"]]
    return output.node.inputs[:2] if output.is_output and _is_product(output.node) else ()


def _is_product(node: bpy.types.Node) -> bool:
    return node.bl_idname == "ShaderNodeMath" and node.operation == "MULTIPLY" and not node.use_clamp


def _of(socket: bpy.types.NodeSocket, known: _Known) -> LightNodes:
    """Return the known factors of a number input."""
    return known[socket.as_pointer()].grey()


def _falloff(output: bpy.types.NodeSocket) -> LightNodes:
    """Return a Light Falloff node's factors for strength 1; raises ComplexError if Smooth is computed."""
    smooth = _constant_number(output.node.inputs["Smooth"])
    return LightNodes(falloff=(_FALLOFF_POWERS[output.identifier], max(smooth, 0.0)))


def own_constants(tree: bpy.types.NodeTree) -> LightNodes:
    """Return the unlinked Color times Strength of a light's Emission node; factor 1 for other shaders."""
    output = tree.get_output_node("CYCLES")
    node = feeding_socket(output.inputs["Surface"]).node
    if node.bl_idname != "ShaderNodeEmission":
        return LightNodes()
    return _constant(node.inputs["Color"]) * _constant(node.inputs["Strength"])


def _constant(socket: bpy.types.NodeSocket) -> LightNodes:
    """Return the socket's own value as a colour."""
    value: Any = getattr(socket, "default_value", 0.0)
    colour = list(value)[:3] if hasattr(value, "__len__") else [value] * 3
    return LightNodes(np.array(colour, np.float64))


def _constant_number(socket: bpy.types.NodeSocket) -> float:
    """Return the value of a number input; raises ComplexError if a node computes it."""
    output = feeding_socket(socket)
    if output.is_output and output.node.bl_idname != "ShaderNodeValue":
        raise ComplexError
    return float(output.default_value)


def _blackbody(node: bpy.types.Node) -> np.ndarray:
    """Return the colour of a Blackbody node, (3,) float64; raises ComplexError if only Cycles computes it."""
    colour = blackbody(_constant_number(node.inputs["Temperature"]))
    if colour is None:
        raise ComplexError
    return colour
