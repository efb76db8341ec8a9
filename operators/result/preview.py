"""Objects that show their lightmaps, and their own materials again.

The preview materials sit in slots linked to the object; what was there is remembered on the object
(`HemibakeObjectProperties.slots`), so that it survives saving and comes back exactly.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ..scene.objects.meshes import read_array
from .preview_material import ShownLightmap, preview_material, remove_unused_previews


def previewable(obj: bpy.types.Object) -> bool:
    """Return whether an object has been baked and its lightmap is still there."""
    return obj.type == "MESH" and obj.is_editable and obj.hemibake.image is not None


def has_preview(obj: bpy.types.Object) -> bool:
    """Return whether an object shows its lightmap."""
    return len(obj.hemibake.slots) > 0


def shows_preview(scene: bpy.types.Scene) -> bool:
    """Return whether an object of a scene shows its lightmap."""
    return any(map(has_preview, scene.objects))


def show_preview(objects: Sequence[bpy.types.Object]) -> list[str]:
    """Give preview materials to objects that do not show any; return sentences for the user."""
    made: dict[tuple[bpy.types.Material | None, ShownLightmap], bpy.types.Material] = {}
    notes: list[str] = []
    for obj in objects:
        if has_preview(obj):
            continue
        if not obj.material_slots and not obj.data.is_editable:
            notes.append(f"Object '{obj.name}' has no material slot and a linked mesh: it has no preview.")
            continue
        _remember(obj)
        for slot in obj.material_slots:
            _show_slot(obj, slot, made)
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
    remove_unused_previews()


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


def _show_slot(obj: bpy.types.Object, slot: bpy.types.MaterialSlot, made: dict) -> None:
    lightmap = ShownLightmap(
        obj.hemibake.image, obj.hemibake.uv_layer, obj.hemibake.uv_scale, tuple(obj.hemibake.uv_offset)
    )
    key = (slot.material, lightmap)
    if key not in made:
        made[key] = preview_material(slot.material, lightmap)
    slot.link = "OBJECT"
    slot.material = made[key]
