"""Checks of the whole scene: hidden objects, missing images, missing light and levels of detail."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence

import bpy

from ..compat import light_power, node_input, node_tree
from ..levels import LevelFinder
from ..object_properties import is_left_out
from ..result.level_maps import TOO_FAR, far_levels
from ..scene import SceneContext
from ..scene.materials.tree_nodes import all_nodes
from ..scene.objects.render_differences import Geometry
from ..scene.objects.visible import visible_objects
from .finding import ERROR, INFO, WARNING, Finding, found

#: Types of objects that have a surface.
_SURFACES = {"MESH", "CURVE", "FONT", "SURFACE", "META"}

#: Types of objects that affect a bake.
_SEEN = {*_SURFACES, "LIGHT"}

#: Input names of colour and strength of the shaders that may emit.
_EMITTERS = {
    "ShaderNodeEmission": ("Color", "Strength"),
    "ShaderNodeBackground": ("Color", "Strength"),
    "ShaderNodeBsdfPrincipled": ("Emission Color", "Emission Strength"),
}

#: Radiance below which a world is dim, W/(m^2 sr); the world of a new file has 0.05 (chosen).
_DIM = 0.1

_DIM_WORLD = (
    "The only light is the dim background of the world, so the lightmaps will be dark. Add a light, or raise "
    "the strength of the background."
)


def check_differences(context: SceneContext) -> list[Finding]:
    """Return findings on objects and meshes that differ between the viewport and renders."""
    layer, levels = context.view_layer, LevelFinder()
    rendered = {obj.session_uid for obj in visible_objects(context)}
    objects = [obj for obj in layer.objects if obj.type in _SEEN and not is_left_out(obj, levels)]
    unrendered = [obj for obj in objects if obj.session_uid not in rendered]
    baked = [obj for obj in objects if obj.session_uid in rendered]
    differing = list(Geometry(context.scene).differing(baked))
    return [
        *found(
            WARNING,
            "Visible in the viewport but hidden in renders, so not baked: {}. Enable it in renders, or "
            "ignore this.",
            [obj.name for obj in unrendered if obj.visible_get(view_layer=layer)],
        ),
        *found(
            INFO,
            "Hidden in the viewport but visible in renders, so baked: {}. Disable it in renders to leave "
            "it out.",
            [obj.name for obj in baked if not obj.visible_get(view_layer=layer)],
        ),
        *_check_geometry([obj.name for obj in differing], context.scene.hemibake.meshes == "RENDER"),
    ]


def check_levels(context: SceneContext, width: int) -> list[Finding]:
    """Return a finding on levels whose surface is far from the surface of their first level.

    width:  width of the lightmaps, texels
    """
    return found(WARNING, TOO_FAR, far_levels(context, width))


def _check_geometry(differing: list[str], as_rendered: bool) -> list[Finding]:
    """Return a finding on objects whose modifiers have other settings in renders."""
    if as_rendered:
        sentence = (
            "Modifiers or particles differ between renders and viewport: {}. The render's mesh is baked."
        )
        return found(INFO, sentence, differing)
    sentence = (
        "Modifiers or particles differ between renders and viewport: {}. The viewport's mesh is baked. "
        "Set Meshes to Render under Advanced, or use the same settings."
    )
    return found(WARNING, sentence, differing)


def check_images(
    objects: Sequence[bpy.types.Object], world: bpy.types.World | None, override: bpy.types.Material | None
) -> list[Finding]:
    """Return findings on objects whose materials use image files that are missing."""
    users: dict[str, set[str]] = {}
    for obj in objects:
        for material in _materials(obj, override):
            for image in _images(node_tree(material)):
                if is_missing(image):
                    users.setdefault(image.name, set()).add(obj.name)
    lost = [image.name for image in _images(world and node_tree(world)) if is_missing(image)]
    findings = []
    for image, names in users.items():
        sentence = (
            f"The file of image '{image}' is missing: magenta is baked on {{}}. "
            "Find it (File > External Data), or choose another one."
        )
        findings += found(WARNING, sentence, list(names))
    findings += [
        Finding(
            WARNING, f"The file of the world's image '{name}' is missing. Find it (File > External Data)."
        )
        for name in lost
    ]
    return findings


def check_light(
    objects: Sequence[bpy.types.Object], world: bpy.types.World | None, override: bpy.types.Material | None
) -> list[Finding]:
    """Return a finding if nothing or only a dim world emits, judged by the nodes without evaluating them.

    override:  material of all surfaces, if the view layer has one
    """
    levels = LevelFinder()
    if any(_is_source(obj, override, levels) for obj in objects):
        return []
    if _may_shine(world):
        return [Finding(INFO, _DIM_WORLD)] if _is_dim(world) else []
    text = "Nothing emits light: the lightmaps would be black. Add a light, an emissive material or a world."
    return [Finding(ERROR, text)]


def is_missing(image: bpy.types.Image) -> bool:
    """Return whether the file of an image is missing."""
    if image.source not in {"FILE", "SEQUENCE", "MOVIE", "TILED"} or image.packed_file:
        return False
    path = bpy.path.abspath(image.filepath, library=image.library)
    if image.source == "TILED" and len(image.tiles):
        path = path.replace("<UDIM>", str(image.tiles[0].number))
    return not os.path.isfile(path)


def _is_source(obj: bpy.types.Object, override: bpy.types.Material | None, levels: LevelFinder) -> bool:
    """Return whether an object may emit light."""
    if is_left_out(obj, levels):
        return False
    if obj.type == "LIGHT":
        return light_power(obj.data) > 0 and any(obj.data.color)
    return any(_may_shine(material) for material in _materials(obj, override))


def _may_shine(owner: bpy.types.Material | bpy.types.World | None) -> bool:
    """Return whether a material or world may emit light."""
    tree = owner and node_tree(owner)
    if not tree:
        return isinstance(owner, bpy.types.World) and any(owner.color)
    return any(_emits(node) for node in all_nodes(tree))


def _is_dim(world: bpy.types.World) -> bool:
    """Return whether a world that may emit has constant radiance below _DIM."""
    tree = node_tree(world)
    if not tree:
        return max(world.color) < _DIM
    radiance = 0.0
    for node in filter(_emits, all_nodes(tree)):
        inputs = [node.inputs[name] for name in _EMITTERS[node.bl_idname]]
        if any(socket.is_linked for socket in inputs):
            return False
        color, strength = (socket.default_value for socket in inputs)
        radiance += max(color[:3]) * strength
    return radiance < _DIM


def _emits(node: bpy.types.Node) -> bool:
    """Return whether a node is a shader that may emit: no input of it is a constant 0."""
    names = _EMITTERS.get(node.bl_idname)
    return names is not None and all(_not_black(node_input(node, name)) for name in names)


def _not_black(socket: bpy.types.NodeSocket | None) -> bool:
    if socket is None:
        return False
    value = socket.default_value
    return socket.is_linked or (any(value[:3]) if hasattr(value, "__len__") else value > 0)


def _materials(obj: bpy.types.Object, override: bpy.types.Material | None) -> Iterator[bpy.types.Material]:
    """Yield the materials of an object's slots; during a preview of lightmaps, the original ones."""
    if override is not None:
        if obj.type in _SURFACES:
            yield override
        return
    own = getattr(obj.data, "materials", ())
    for index, slot in enumerate(obj.hemibake.slots or obj.material_slots):
        of_data = own[index] if index < len(own) else None
        material = slot.material if slot.link == "OBJECT" else of_data
        if material is not None:
            yield material


def _images(tree: bpy.types.NodeTree | None) -> Iterator[bpy.types.Image]:
    for node in all_nodes(tree):
        image = getattr(node, "image", None)
        if image is not None:
            yield image
