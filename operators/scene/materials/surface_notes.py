"""Notes on surfaces that bakes show differently from renders."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import bpy

from ....engine.object_message import counted, listing
from ...compat import node_tree
from .closures import PRINCIPLED, is_glass, is_hair, is_unknown, may_emit
from .ray_kinds import is_by_bounce, reads_ray_depth
from .rough_diffuse import is_rough
from .smooth_metals import is_mirror
from .sockets import channels, feeding_socket, number_of
from .tree_nodes import used_nodes
from .view_nodes import depends_on_view

_VOLUMES = "The volumes of materials {} are not baked."
_COATS = "The tint of the coat of materials {} is not baked."
_DEPTHS = "Materials {} depend on a ray depth. A bake uses the depth of a first bounce. Replace that output."
_SHEENS = (
    "Materials {} have sheen, whose reflected light is not baked. Set it to 0 for the same light in renders."
)
_HAIR = "Materials {} have hair nodes, which bakes show black on faces. Use other shaders for faces."
_LENGTHS = "Materials {} depend on Ray Length. A bake uses the length 1. Replace that node."
_OCCLUSIONS = (
    "Materials {}: bakes evaluate their Ambient Occlusion nodes without other objects. "
    "Bake the node into an image."
)
_VIEWS = (
    "Materials {} depend on the view. A bake uses the view along the normal. "
    "Replace the Layer Weight, Fresnel, Camera Data or coordinate node."
)
_ROUGH = (
    "Materials {} have diffuse roughness. It darkens the light that they reflect, but not their own "
    "lightmaps. Set it to 0 for the same light in both."
)
_BOUNCES = (
    "Materials {} emit light by a node that separates kinds of bounces. Cycles also samples their emission "
    "without a bounce, so a bake differs. Use Is Camera Ray instead."
)
_INSTANCERS = (
    "Materials {} use coordinates of instancers or particles, for which bakes use 0. Replace them with an "
    "Attribute node of type Instancer."
)
_INVALID = "Material '{}': input '{}' of node '{}' is NaN or infinite. Correct the number."

_TOON = "Materials {} have Toon nodes, which bakes treat as Diffuse. Replace the nodes."
_PORTALS = (
    "Materials {} have Ray Portal nodes, through which light of a bake does not pass. "
    "Replace them with Transparent BSDF nodes."
)

#: Sentences about nodes of one type.
_NODE_TYPES = {
    "ShaderNodeAmbientOcclusion": _OCCLUSIONS,
    "ShaderNodeBsdfToon": _TOON,
    "ShaderNodeBsdfRayPortal": _PORTALS,
}

_FALLOFF = "ShaderNodeLightFalloff"

#: Outputs that depend on the length of a ray, by type of node.
_LENGTH_OUTPUTS = {"ShaderNodeLightPath": ("Ray Length",), _FALLOFF: ("Linear", "Constant")}

#: Inputs with the weight of a node's sheen, by type of node; a Sheen BSDF has none.
_SHEEN_WEIGHTS = {PRINCIPLED: "Sheen Weight", "ShaderNodeBsdfSheen": "", "ShaderNodeBsdfVelvet": ""}

#: Numbers of nodes from which on they count as infinite; Blender replaces infinity by the largest float.
_LARGEST = 1e30


class SurfaceNotes:
    """Collects materials that refract or mirror light, depend on the view, are rough, or not baked in part.

    glass:  True if refracting closures transmit light without refraction
    """

    def __init__(self, glass: bool) -> None:
        self._glass = glass
        # Names of materials, by the test that they pass, or by sentence.
        self._noted = defaultdict[object, set[str]](set)
        self._invalid: set[str] = set()
        self._unknown: dict[str, str] = {}

    def add(self, material: bpy.types.Material | None) -> None:
        """Examine the nodes of a material."""
        if material is not None and (tree := node_tree(material)) is not None:
            self._add(material, tree)

    def _add(self, material: bpy.types.Material, tree: bpy.types.NodeTree) -> None:
        output = tree.get_output_node("CYCLES")
        if output is None:
            return
        if feeding_socket(output.inputs["Volume"]).is_output:
            self._noted[_VOLUMES].add(material.name)
        for test in (is_mirror, depends_on_view):
            if test(tree):
                self._noted[test].add(material.name)
        for node in used_nodes(tree):
            self._add_node(material.name, node)

    def _add_node(self, material: str, node: bpy.types.Node) -> None:
        for test in _NODE_TESTS:
            if test(node):
                self._noted[test].add(material)
        if node.bl_idname in _NODE_TYPES:
            self._noted[_NODE_TYPES[node.bl_idname]].add(material)
        for socket in _invalid_inputs(node):
            self._invalid.add(_INVALID.format(material, socket.name, node.name))
        if is_unknown(node):
            self._unknown[material] = node.name

    def sentences(self) -> list[str]:
        """Return a sentence for each kind of difference."""
        notes, noted = [], self._noted
        refracting, mirrors = sorted(noted[is_glass]), sorted(noted[is_mirror])
        if refracting and self._glass:
            count = counted(len(refracting), "glass material")
            verb = "transmits" if len(refracting) == 1 else "transmit"
            notes.append(listing(f"{count} {verb} light without refraction: {{}}.", refracting))
        if mirrors:
            count = counted(len(mirrors), "smooth metal")
            verb = "reflects" if len(mirrors) == 1 else "reflect"
            sentence = f"{count} {verb} light in all directions instead of mirroring it: {{}}."
            notes.append(listing(sentence, mirrors))
        bounced = noted[is_by_bounce] & noted[may_emit]
        kinds = (
            (noted[_VOLUMES], _VOLUMES), (noted[_has_tinted_coat], _COATS),
            (noted[_reads_ray_length], _LENGTHS), (noted[reads_ray_depth] - bounced, _DEPTHS),
            (noted[_has_sheen], _SHEENS), (noted[is_hair], _HAIR), (noted[_OCCLUSIONS], _OCCLUSIONS),
            (noted[depends_on_view], _VIEWS), (noted[is_rough], _ROUGH), (bounced, _BOUNCES),
            (noted[_reads_instancer], _INSTANCERS),
            (noted[_TOON], _TOON), (noted[_PORTALS], _PORTALS),
        )  # fmt: skip
        notes += [listing(sentence, sorted(materials)) for materials, sentence in kinds if materials]
        notes += sorted(self._invalid)
        for material, node in sorted(self._unknown.items()):
            notes.append(
                f"Material '{material}': node '{node}' is not known and is baked black. Replace the node."
            )
        return notes


def _reads_ray_length(node: bpy.types.Node) -> bool:
    """Return True if a node depends on the length of a ray."""
    names = _LENGTH_OUTPUTS.get(node.bl_idname, ())
    if node.bl_idname == _FALLOFF and number_of(node.inputs["Smooth"], linked=1.0) > 0:
        names = tuple(node.outputs.keys())
    return any(node.outputs[name].is_linked for name in names)


def _reads_instancer(node: bpy.types.Node) -> bool:
    """Return True if a node has values of the instancer or the particle of an instance."""
    if node.bl_idname == "ShaderNodeParticleInfo":
        return True
    of_instancer = getattr(node, "from_instancer", False)
    uvs = [output for output in node.outputs if output.name in {"UV", "Generated"}]
    return of_instancer and any(output.is_linked for output in uvs)


def _invalid_inputs(node: bpy.types.Node) -> list[bpy.types.NodeSocket]:
    """Return the unlinked inputs of a node, and the outputs of constants, that are not finite numbers."""
    own = [
        socket for socket in (*node.inputs, *node.outputs) if not (socket.is_linked and not socket.is_output)
    ]
    return [socket for socket in own if not _is_valid(getattr(socket, "default_value", 0.0))]


def _is_valid(value: Any) -> bool:
    """Return False for a number or an array of numbers with NaN, or infinity, which Blender may clamp."""
    if isinstance(value, float):
        return abs(value) < _LARGEST
    is_array = hasattr(value, "__len__") and not isinstance(value, str)
    return not is_array or all(abs(number) < _LARGEST for number in value)


def _has_sheen(node: bpy.types.Node) -> bool:
    """Return True if a node reflects light by microfibers."""
    name = _SHEEN_WEIGHTS.get(node.bl_idname)
    weight = node.inputs.get(name) if name else None
    return name == "" or (weight is not None and number_of(weight, linked=1.0) > 0)


def _has_tinted_coat(node: bpy.types.Node) -> bool:
    """Return True if a node has a coat whose tint is not white."""
    weight, tint = node.inputs.get("Coat Weight"), node.inputs.get("Coat Tint")
    if weight is None or tint is None:
        return False
    color = feeding_socket(tint)
    return number_of(weight, linked=1.0) > 0 and (color.is_output or min(channels(color)) < 1)


#: Tests of nodes; the materials that pass one are collected.
_NODE_TESTS = (
    is_glass, _has_tinted_coat, _reads_ray_length, reads_ray_depth, _has_sheen, is_hair, is_rough,
    is_by_bounce, may_emit, _reads_instancer,
)  # fmt: skip
