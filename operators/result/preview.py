"""Materials that show a surface lit by nothing but its lightmap.

The preview materials sit in slots linked to the object; what was there is remembered on the object
(`HemibakeObjectProperties.slots`), so that it survives saving and comes back exactly.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from ...engine.scene import Material
from ..compat import new_node_tree
from ..scene.materials import read_material

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
    made: dict[tuple[bpy.types.Material | None, bpy.types.Image, str], bpy.types.Material] = {}
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
            obj.data.materials.clear()
        obj.hemibake.slot_added = False
        obj.hemibake.slots.clear()
    for material in [item for item in bpy.data.materials if item.get(MARK) and not item.users]:
        bpy.data.materials.remove(material)


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
    original, uv_layer = slot.material, obj.hemibake.uv_layer
    key = (original, obj.hemibake.image, uv_layer)
    if key not in made:
        made[key] = _preview_material(original, obj.hemibake.image, uv_layer, notes)
    slot.link = "OBJECT"
    slot.material = made[key]


def _preview_material(
    original: bpy.types.Material | None, image: bpy.types.Image, uv_layer: str, notes: list[str]
) -> bpy.types.Material:
    """Return a material that emits reflectance x lightmap + emission."""
    constants = read_material(original, notes)
    material = bpy.data.materials.new(f"{constants.name} (lightmap)")
    material[MARK] = True
    material.diffuse_color = (*constants.reflectance.tolist(), 1.0)
    _build_nodes(new_node_tree(material), constants, image, uv_layer)
    return material


def _build_nodes(
    tree: bpy.types.NodeTree, constants: Material, image: bpy.types.Image, uv_layer: str
) -> None:
    """UV Map -> Image Texture -> multiply, add -> Emission -> Material Output."""
    tree.nodes.clear()
    uv = _node(tree, "ShaderNodeUVMap", 0)
    uv.uv_map = uv_layer
    texture = _node(tree, "ShaderNodeTexImage", 1)
    texture.image, texture.interpolation, texture.extension = image, "Linear", "EXTEND"
    light = _node(tree, "ShaderNodeVectorMath", 2)
    light.operation, light.label = "MULTIPLY_ADD", "Reflectance x lightmap + emission"
    light.inputs[1].default_value = constants.reflectance.tolist()
    light.inputs[2].default_value = constants.emission.tolist()
    emission = _node(tree, "ShaderNodeEmission", 3)
    output = _node(tree, "ShaderNodeOutputMaterial", 4)
    tree.links.new(uv.outputs["UV"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], light.inputs[0])
    tree.links.new(light.outputs["Vector"], emission.inputs["Color"])
    tree.links.new(emission.outputs["Emission"], output.inputs["Surface"])


def _node(tree: bpy.types.NodeTree, kind: str, column: int) -> bpy.types.Node:
    node = tree.nodes.new(kind)
    node.location = (280 * column, 0)
    return node
