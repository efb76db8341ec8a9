"""Notes on surfaces that bakes show differently from renders."""

from __future__ import annotations

import bpy

from ....engine.object_message import counted, listing
from ...compat import node_tree
from .closures import is_glass, is_unknown
from .rough_diffuse import is_rough
from .smooth_metals import is_mirror
from .sockets import channels, feeding_socket, number_of
from .tree_nodes import used_nodes
from .view_nodes import depends_on_view

_VOLUMES = "The volumes of materials {} are not baked."
_COATS = "The tint of the coat of materials {} is not baked."
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
_TOONS = "Materials {} have Toon nodes, which bakes treat as Diffuse. Replace the nodes."


class SurfaceNotes:
    """Collects materials that refract or mirror light, depend on the view, are rough, or not baked in part.

    glass:  True if refracting closures transmit light without refraction
    """

    def __init__(self, glass: bool) -> None:
        self._glass = glass
        self._refracting: set[str] = set()
        self._mirrors: set[str] = set()
        self._volumes: set[str] = set()
        self._coats: set[str] = set()
        self._lengths: set[str] = set()
        self._occlusions: set[str] = set()
        self._views: set[str] = set()
        self._rough: set[str] = set()
        self._toons: set[str] = set()
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
            self._volumes.add(material.name)
        if is_mirror(tree):
            self._mirrors.add(material.name)
        if depends_on_view(tree):
            self._views.add(material.name)
        for node in used_nodes(tree):
            self._add_node(material.name, node)

    def _add_node(self, material: str, node: bpy.types.Node) -> None:
        if is_glass(node):
            self._refracting.add(material)
        if _has_tinted_coat(node):
            self._coats.add(material)
        if node.bl_idname == "ShaderNodeLightPath" and node.outputs["Ray Length"].is_linked:
            self._lengths.add(material)
        if node.bl_idname == "ShaderNodeAmbientOcclusion":
            self._occlusions.add(material)
        if is_rough(node):
            self._rough.add(material)
        if node.bl_idname == "ShaderNodeBsdfToon":
            self._toons.add(material)
        if is_unknown(node):
            self._unknown[material] = node.name

    def sentences(self) -> list[str]:
        """Return a sentence for each kind of difference."""
        notes = []
        if self._refracting and self._glass:
            count = counted(len(self._refracting), "glass material")
            verb = "transmits" if len(self._refracting) == 1 else "transmit"
            notes.append(listing(f"{count} {verb} light without refraction: {{}}.", sorted(self._refracting)))
        if self._mirrors:
            count = counted(len(self._mirrors), "smooth metal")
            verb = "reflects" if len(self._mirrors) == 1 else "reflect"
            sentence = f"{count} {verb} light in all directions instead of mirroring it: {{}}."
            notes.append(listing(sentence, sorted(self._mirrors)))
        kinds = (
            (self._volumes, _VOLUMES), (self._coats, _COATS), (self._lengths, _LENGTHS),
            (self._occlusions, _OCCLUSIONS), (self._views, _VIEWS), (self._rough, _ROUGH),
            (self._toons, _TOONS),
        )  # fmt: skip
        notes += [listing(sentence, sorted(materials)) for materials, sentence in kinds if materials]
        for material, node in sorted(self._unknown.items()):
            notes.append(
                f"Material '{material}': node '{node}' is not known and is baked black. Replace the node."
            )
        return notes


def _has_tinted_coat(node: bpy.types.Node) -> bool:
    """Return True if a node has a coat whose tint is not white."""
    weight, tint = node.inputs.get("Coat Weight"), node.inputs.get("Coat Tint")
    if weight is None or tint is None:
        return False
    color = feeding_socket(tint)
    return number_of(weight, linked=1.0) > 0 and (color.is_output or min(channels(color)) < 1)
