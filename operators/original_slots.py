"""Original materials of slots, also while their object shows its lightmap."""

from __future__ import annotations

from typing import Any

import bpy

#: Custom property that marks a preview material and its own node groups and images.
PREVIEW_MARK = "hemibake_preview"


def is_filled(slot: bpy.types.MaterialSlot) -> bool:
    """Return True if a slot holds a material other than the copies that show lightmaps."""
    return slot.material is not None and PREVIEW_MARK not in slot.material


def own_slots(obj: bpy.types.Object) -> list[Any]:
    """Return the original material and link of each slot: a stored record, or the slot itself.

    A slot that the user has filled or added while the lightmap was shown has no stored record.
    """
    before = obj.hemibake.slots
    return [
        before[index] if index < len(before) and not is_filled(slot) else slot
        for index, slot in enumerate(obj.material_slots)
    ]


def shown_materials(
    mesh: bpy.types.Mesh, obj: bpy.types.Object, override: bpy.types.Material | None
) -> list[bpy.types.Material | None]:
    """Return the original material of each slot of an object's evaluated mesh, at least one entry.

    Materials linked to the object replace the mesh's materials. Copies that show lightmaps are ignored.

    override: material of the view layer that replaces all others, or None
    """
    if override is not None:
        return [override] * max(len(mesh.materials), 1)
    materials = [material and material.original for material in mesh.materials]
    for index, slot in enumerate(own_slots(obj)):
        if slot.link == "OBJECT" and index < len(materials):
            materials[index] = slot.material
    return materials or [None]
