"""Preview material: a copy of a material that shows a lightmap through emission.

Each diffuse shader is replaced by Emission shaders of its exitant radiance, reflectance x lightmap +
emission. All other nodes stay, so that textures, groups, mixing, transparency and culling act on the emission
as before. Metal, glass and gloss still reflect their environment.
"""

from __future__ import annotations

import bpy

from ..compat import new_node_tree, node_tree
from ..original_slots import PREVIEW_MARK
from ..scene.materials.tree_nodes import all_nodes
from .color_nodes import ColorNodes, ShownColors
from .lightmap_nodes import LightmapNodes, ShownLightmap
from .nodes import Feed, feed, feeding_output, make_node
from .probe_nodes import ProbeNodes, ShownProbes

#: Light that a preview shows on an object.
ShownLight = ShownLightmap | ShownProbes | ShownColors

#: Width of a node column.
_COLUMN = 180


def preview_material(original: bpy.types.Material | None, lightmap: ShownLight) -> bpy.types.Material:
    """Return a copy of a material that shows baked light; no material counts as Cycles' default grey."""
    material = bpy.data.materials.new("(no material)") if original is None else original.copy()
    material.name = f"{'(no material)' if original is None else original.name} (lightmap)"
    material.use_fake_user = False
    material[PREVIEW_MARK] = True
    if original is None or node_tree(material) is None:
        _plain_nodes(material)
    _Relighting(lightmap).light(material.node_tree)
    return material


def remove_unused_previews() -> None:
    """Remove unused preview materials, then their node groups, outer ones first, and images."""
    for collection in (bpy.data.materials, bpy.data.node_groups, bpy.data.images):
        while unused := [item for item in collection if item.get(PREVIEW_MARK) and not item.users]:
            for item in unused:
                collection.remove(item)


def _plain_nodes(material: bpy.types.Material) -> None:
    """Create nodes with the color of a material without nodes."""
    tree = new_node_tree(material)
    tree.nodes.clear()
    shader, output = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    shader.inputs["Color"].default_value = material.diffuse_color
    tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])


class _Relighting:
    """Replacement of diffuse shaders by lightmap emission, in a tree and in copies of its groups."""

    def __init__(self, lightmap: ShownLight) -> None:
        self._lightmap = lightmap
        self._groups: dict[bpy.types.NodeTree, bpy.types.NodeTree] = {}

    def light(self, tree: bpy.types.NodeTree) -> None:
        """Replace the diffuse shaders of a tree."""
        lit = _LitTree(tree, self._lightmap)
        for node in [node for node in tree.nodes if not node.mute]:
            group = getattr(node, "node_tree", None)
            if group is not None and _has_diffuse(group):
                node.node_tree = self._copy(group)
            elif _is_diffuse(node):
                _REPLACEMENTS[node.bl_idname](lit, node)

    def _copy(self, group: bpy.types.NodeTree) -> bpy.types.NodeTree:
        if group not in self._groups:
            copy = self._groups[group] = group.copy()
            copy.name, copy.use_fake_user, copy[PREVIEW_MARK] = f"{group.name} (lightmap)", False, True
            self.light(copy)
        return self._groups[group]


def _has_diffuse(tree: bpy.types.NodeTree) -> bool:
    """Return True if a tree or a group in it has a diffuse shader."""
    return any(map(_is_diffuse, all_nodes(tree)))


def _is_diffuse(node: bpy.types.Node) -> bool:
    """Return True if a node is active and diffuse."""
    glossy = getattr(node, "component", "DIFFUSE") == "GLOSSY"
    return node.bl_idname in _REPLACEMENTS and not node.mute and not glossy


class _LitTree:
    """Node tree whose diffuse shaders are being replaced by emission shaders that show the lightmap."""

    def __init__(self, tree: bpy.types.NodeTree, lightmap: ShownLight) -> None:
        self._tree, self._lightmap = tree, lightmap
        self._light: LightmapNodes | ProbeNodes | ColorNodes | None = None

    def make(
        self, kind: str, beside: bpy.types.Node, column: int, *inputs: Feed, **settings: object
    ) -> bpy.types.NodeSocket:
        """Return the first output of a new node, in a column next to another node."""
        x, y = beside.location
        place = (x + _COLUMN * column, y - _COLUMN * (len(inputs) - 1))
        output = make_node(self._tree, kind, place, *inputs, **settings)
        output.node.parent = beside.parent
        return output

    def feed(self, socket: bpy.types.NodeSocket, source: Feed) -> None:
        """Connect an input."""
        feed(self._tree, socket, source)

    def reflected(self, node: bpy.types.Node, colour: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return an emission shader of an input's color times the lightmap."""
        label = "Reflectance x lightmap"
        inputs = (colour, self._light_on(node))
        product = self.make("ShaderNodeVectorMath", node, 1, *inputs, operation="MULTIPLY", label=label)
        return self.make("ShaderNodeEmission", node, 2, product)

    def remove(self, node: bpy.types.Node) -> None:
        """Remove a node."""
        self._tree.nodes.remove(node)

    def _light_on(self, node: bpy.types.Node) -> bpy.types.NodeSocket:
        """Return the socket of E/pi for a shader; with directional maps, for the shader's own normal."""
        if self._light is None:
            self._light = _light_nodes(self._tree, self._lightmap)
        normal = feeding_output(node.inputs["Normal"]) if "Normal" in node.inputs else None
        if normal is None or isinstance(self._light, ColorNodes) or not self._light.has_directions:
            return self._light.colour
        return self._light.shaded(normal)


def _light_nodes(tree: bpy.types.NodeTree, light: ShownLight) -> LightmapNodes | ProbeNodes | ColorNodes:
    """Return the nodes that read baked light."""
    if isinstance(light, ShownProbes):
        return ProbeNodes(tree, light)
    return ColorNodes(tree, light) if isinstance(light, ShownColors) else LightmapNodes(tree, light)


def _holds(socket: bpy.types.NodeSocket, value: float) -> bool:
    """Return True if an input is unlinked and has this value."""
    return feeding_output(socket) is None and socket.default_value == value


def _diffuse(lit: _LitTree, node: bpy.types.Node) -> None:
    """Replace a purely diffuse shader."""
    targets = _targets(node)
    shader = lit.reflected(node, node.inputs["Color"])
    for socket in targets:
        lit.feed(socket, shader)
    lit.remove(node)


def _principled(lit: _LitTree, node: bpy.types.Node) -> None:
    """Replace diffuse part and emission of a Principled BSDF, with alpha; metal and glass stay."""
    targets = _targets(node)
    shader = lit.reflected(node, node.inputs["Base Color"])
    colour, strength, alpha = (node.inputs[name] for name in ("Emission Color", "Emission Strength", "Alpha"))
    mirrors = not all(_holds(node.inputs[name], 0) for name in ("Metallic", "Transmission Weight"))
    if mirrors:
        shader = _mirrored(lit, node, shader)
    if not _holds(strength, 0):
        emission = lit.make("ShaderNodeEmission", node, 4, colour, strength)
        shader = lit.make("ShaderNodeAddShader", node, 5, shader, emission)
    if not _holds(alpha, 1):
        clear = lit.make("ShaderNodeBsdfTransparent", node, 5)
        shader = lit.make("ShaderNodeMixShader", node, 6, alpha, clear, shader)
    for socket in targets:
        lit.feed(socket, shader)
    if mirrors:
        lit.feed(strength, 0.0)
        lit.feed(alpha, 1.0)
    else:
        lit.remove(node)


def _mirrored(lit: _LitTree, node: bpy.types.Node, shader: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """Mix the diffuse part with a Principled BSDF that keeps metal and glass.

    The diffuse part has the weight w = (1 - metallic)(1 - transmission). Of the rest, the fraction metallic /
    (1 - w) is metal.
    """
    metallic, transmission = node.inputs["Metallic"], node.inputs["Transmission Weight"]

    def number(operation: str, *inputs: Feed) -> bpy.types.NodeSocket:
        return lit.make("ShaderNodeMath", node, -1, *inputs, operation=operation, use_clamp=True)

    opaque, dielectric = number("SUBTRACT", 1.0, transmission), number("SUBTRACT", 1.0, metallic)
    diffuse = number("MULTIPLY", opaque, dielectric)
    metal = number("DIVIDE", metallic, number("SUBTRACT", 1.0, diffuse))
    lit.feed(metallic, metal)
    lit.feed(transmission, 1.0)
    return lit.make("ShaderNodeMixShader", node, 3, diffuse, node.outputs[0], shader)


def _targets(node: bpy.types.Node) -> list[bpy.types.NodeSocket]:
    """Return the inputs to which a shader's output is linked."""
    return [link.to_socket for link in node.outputs[0].links if not link.is_muted]


_REPLACEMENTS = {
    "ShaderNodeBsdfPrincipled": _principled,
    "ShaderNodeBsdfDiffuse": _diffuse,
    "ShaderNodeBsdfToon": _diffuse,
    "ShaderNodeBsdfTranslucent": _diffuse,
    "ShaderNodeSubsurfaceScattering": _diffuse,
}
