"""Materials that show a surface lit by nothing but its lightmap.

The preview materials sit in slots linked to the object; what was there is remembered on the object
(`HemibakeObjectProperties.slots`), so that it survives saving and comes back exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ...engine.scene.model import Material, Texture
from ..compat import new_node_tree
from ..scene.materials.materials import read_material
from ..scene.materials.pixels import PixelCache
from ..scene.materials.sockets import ComplexError
from ..scene.objects.meshes import read_array

#: Custom property that marks a preview material.
MARK = "hemibake_preview"


def previewable(obj: bpy.types.Object) -> bool:
    """Return whether an object has been baked and its lightmap is still there."""
    return obj.type == "MESH" and obj.is_editable and obj.hemibake.image is not None


def has_preview(obj: bpy.types.Object) -> bool:
    """Return whether an object shows its lightmap."""
    return len(obj.hemibake.slots) > 0


def show_preview(objects: Sequence[bpy.types.Object]) -> list[str]:
    """Give preview materials to objects that do not show any; return sentences for the user."""
    made: dict[tuple[bpy.types.Material | None, _Lightmap], bpy.types.Material] = {}
    notes: list[str] = []
    for obj in objects:
        if has_preview(obj):
            continue
        if not obj.material_slots and not obj.data.is_editable:
            notes.append(f"Object '{obj.name}' has no material slot and a linked mesh: it has no preview.")
            continue
        _remember(obj)
        for slot in obj.material_slots:
            _show_slot(obj, slot, made, notes)
    return notes


def hide_preview(objects: Sequence[bpy.types.Object]) -> None:
    """Give objects their own materials back and remove preview materials that nobody uses."""
    for obj in objects:
        for slot, before in zip(obj.material_slots, obj.hemibake.slots, strict=False):
            slot.link = "OBJECT"
            slot.material = before.material
            slot.link = before.link
    for obj in objects:
        if obj.hemibake.slot_added and len(obj.data.materials) == 1:
            _remove_slot(obj.data)
        obj.hemibake.slot_added = False
        obj.hemibake.slots.clear()
    for material in [item for item in bpy.data.materials if item.get(MARK) and not item.users]:
        bpy.data.materials.remove(material)


def _remove_slot(mesh: bpy.types.Mesh) -> None:
    """Take the only slot away from a mesh; the faces keep the indices that Blender would drop."""
    before = read_array(mesh.polygons, "material_index", 1, np.int32)[:, 0]
    stored = "material_index" in mesh.attributes or before.any()
    mesh.materials.clear()
    if stored:
        mesh.polygons.foreach_set("material_index", before)


def _remember(obj: bpy.types.Object) -> None:
    """Store what the slots of an object hold; one without slots gets one."""
    if not obj.material_slots:
        obj.data.materials.append(None)
        obj.hemibake.slot_added = True
    for slot in obj.material_slots:
        before = obj.hemibake.slots.add()
        before.link = slot.link
        slot.link = "OBJECT"
        before.material = slot.material
        slot.link = before.link


def _show_slot(obj: bpy.types.Object, slot: bpy.types.MaterialSlot, made: dict, notes: list[str]) -> None:
    lightmap = _Lightmap(
        obj.hemibake.image, obj.hemibake.uv_layer, obj.hemibake.uv_scale, tuple(obj.hemibake.uv_offset)
    )
    key = (slot.material, lightmap)
    if key not in made:
        made[key] = _preview_material(slot.material, lightmap, notes)
    slot.link = "OBJECT"
    slot.material = made[key]


@dataclass(frozen=True)
class _Lightmap:
    """Where an object's light is: lightmap uv = uv of the layer * scale + offset."""

    image: bpy.types.Image
    uv_layer: str
    scale: float
    offset: tuple[float, float]


def _preview_material(
    original: bpy.types.Material | None, lightmap: _Lightmap, notes: list[str]
) -> bpy.types.Material:
    """Return a material that emits reflectance x lightmap + emission."""
    try:
        surface = read_material(original, notes, PixelCache(notes))
    except ComplexError:
        surface = Material(original.name, np.full(3, 0.8, np.float32), np.zeros(3, np.float32))
        notes.append(f"The preview shows material '{original.name}' grey: its nodes are too complex for it.")
    material = bpy.data.materials.new(f"{surface.name} (lightmap)")
    material[MARK] = True
    material.diffuse_color = (*surface.reflectance.tolist(), 1.0)
    _build_nodes(new_node_tree(material), surface, lightmap)
    return material


def _build_nodes(tree: bpy.types.NodeTree, surface: Material, lightmap: _Lightmap) -> None:
    """UV Map -> scale, offset -> Image Texture -> multiply, add -> Emission -> Material Output."""
    tree.nodes.clear()
    uv = _node(tree, "ShaderNodeUVMap", 0)
    uv.uv_map = lightmap.uv_layer
    move = _node(tree, "ShaderNodeVectorMath", 1)
    move.operation, move.label = "MULTIPLY_ADD", "Place in the atlas"
    move.inputs[1].default_value = (lightmap.scale, lightmap.scale, 1)
    move.inputs[2].default_value = (*lightmap.offset, 0)
    texture = _node(tree, "ShaderNodeTexImage", 2)
    texture.image, texture.interpolation, texture.extension = lightmap.image, "Linear", "EXTEND"
    light = _node(tree, "ShaderNodeVectorMath", 4)
    light.operation, light.label = "MULTIPLY_ADD", "Reflectance x lightmap + emission"
    _feed(tree, light.inputs[1], surface.reflectance, surface.reflectance_map, -300)
    _feed(tree, light.inputs[2], surface.emission, surface.emission_map, -600)
    emission = _node(tree, "ShaderNodeEmission", 5)
    output = _node(tree, "ShaderNodeOutputMaterial", 6)
    tree.links.new(uv.outputs["UV"], move.inputs[0])
    tree.links.new(move.outputs["Vector"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], light.inputs[0])
    tree.links.new(light.outputs["Vector"], emission.inputs["Color"])
    tree.links.new(emission.outputs["Emission"], output.inputs["Surface"])


def _feed(
    tree: bpy.types.NodeTree,
    socket: bpy.types.NodeSocket,
    colour: np.ndarray,
    texture: Texture | None,
    y: float,
) -> None:
    """Let an input show a colour, times an image texture if there is one."""
    socket.default_value = colour.tolist()
    image = texture and bpy.data.images.get(texture.name)
    if not image:
        return
    picture, product = _node(tree, "ShaderNodeTexImage", 2, y), _node(tree, "ShaderNodeVectorMath", 3, y)
    picture.image, picture.extension = image, texture.extension.upper()
    picture.interpolation = "Linear" if texture.smooth else "Closest"
    product.operation = "MULTIPLY"
    product.inputs[1].default_value = colour.tolist()
    _feed_uv(tree, picture.inputs["Vector"], texture, y)
    tree.links.new(picture.outputs["Color"], product.inputs[0])
    tree.links.new(product.outputs["Vector"], socket)


def _feed_uv(tree: bpy.types.NodeTree, socket: bpy.types.NodeSocket, texture: Texture, y: float) -> None:
    """Let an image texture lie where the engine's texture lies: UV times a matrix, row by row."""
    uv, both = _node(tree, "ShaderNodeUVMap", 0, y), _node(tree, "ShaderNodeCombineXYZ", 1, y)
    uv.uv_map = texture.uv_map
    for row, axis in enumerate("XY"):
        u, v, shift = texture.transform[row]
        dot, add = _node(tree, "ShaderNodeVectorMath", 0, y), _node(tree, "ShaderNodeMath", 1, y)
        dot.operation, add.operation = "DOT_PRODUCT", "ADD"
        dot.inputs[1].default_value = (u, v, 0)
        add.inputs[1].default_value = shift
        tree.links.new(uv.outputs["UV"], dot.inputs[0])
        tree.links.new(dot.outputs["Value"], add.inputs[0])
        tree.links.new(add.outputs["Value"], both.inputs[axis])
    tree.links.new(both.outputs["Vector"], socket)


def _node(tree: bpy.types.NodeTree, kind: str, column: int, y: float = 0) -> bpy.types.Node:
    node = tree.nodes.new(kind)
    node.location = (280 * column, y)
    return node
