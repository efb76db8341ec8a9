"""Which lightmap each object goes to."""

from __future__ import annotations

from collections.abc import Sequence

import bpy


def assign_atlases(objects: Sequence[bpy.types.Object], notes: list[str]) -> list[str]:
    """Return the atlas name of each object.

    Objects that share a mesh share its UVs and would lie on top of each other: within an atlas
    the first keeps it, each other one gets an atlas of its own, which is said in `notes`.
    """
    taken: set[tuple[str, int]] = set()
    names = []
    for obj in objects:
        name = obj.hemibake.atlas
        key = (name, obj.data.session_uid)
        if key in taken:
            name = f"{name}.{obj.name}"
            notes.append(
                f"Object '{obj.name}' shares the mesh '{obj.data.name}' with another object: "
                f"it has the lightmap '{name}' of its own."
            )
        taken.add(key)
        names.append(name)
    return names
