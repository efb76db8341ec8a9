"""Unique names of the light states of a scene."""

from __future__ import annotations

from collections.abc import Collection

import bpy


def free_state_name(wanted: str, taken: Collection[str]) -> str:
    """Return a name, with a number if it is taken, as Blender names datablocks."""
    names = (wanted if number == 0 else f"{wanted}.{number:03d}" for number in range(len(taken) + 1))
    return next(name for name in names if name not in taken)


def make_state_name_unique(state: bpy.types.PropertyGroup, _: bpy.types.Context) -> None:
    """Give a renamed light state a number if another state of the scene has its name."""
    others = [other.name for other in state.id_data.hemibake.light_states if other != state]
    free = free_state_name(state.name, others)
    if free != state.name:
        state.name = free
