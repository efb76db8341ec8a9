"""Material slots as a person has filled them, while their object may show its lightmap."""

from __future__ import annotations

from typing import Any

import bpy

from .result.preview_material import MARK


def is_filled(slot: bpy.types.MaterialSlot) -> bool:
    """Return whether a slot holds a material of a person's."""
    return slot.material is not None and MARK not in slot.material


def own_slots(obj: bpy.types.Object) -> list[Any]:
    """Return what holds each slot's own material and link: the slot, or what was remembered of it.

    A slot that was filled, or added, while the preview is shown counts as it is.
    """
    before = obj.hemibake.slots
    return [
        before[index] if index < len(before) and not is_filled(slot) else slot
        for index, slot in enumerate(obj.material_slots)
    ]


def shown_materials(
    mesh: bpy.types.Mesh, obj: bpy.types.Object, override: bpy.types.Material | None
) -> list[bpy.types.Material | None]:
    """Return the material of each slot of an object's evaluated mesh: the object's own where the slot has it.

    While the object shows its lightmap, what the preview has put there does not count. One slot at least.

    override: material of all slots, if the view layer has one
    """
    if override is not None:
        return [override] * max(len(mesh.materials), 1)
    materials = [material and material.original for material in mesh.materials]
    for index, slot in enumerate(own_slots(obj)):
        if slot.link == "OBJECT" and index < len(materials):
            materials[index] = slot.material
    return materials or [None]
