"""Values of the user's scene that nodes read in the temporary scenes in which Cycles evaluates them."""

from __future__ import annotations

from typing import Any

import bpy

from .scene_context import SceneContext


def share_values(context: SceneContext, scene: bpy.types.Scene) -> None:
    """Copy the frame and the custom properties of the user's scene to a temporary scene.

    Drivers, image sequences and animated values of copied datablocks depend on the frame.
    """
    source = context.scene
    scene.frame_current, scene.frame_subframe = source.frame_current, source.frame_subframe
    share_properties(context, scene)


def share_properties(context: SceneContext, owner: bpy.types.Scene | bpy.types.World) -> None:
    """Copy the custom properties that Attribute nodes of type View Layer read to another owner.

    Blender reads them from the view layer, the scene and its world, in this order.
    """
    owners = (context.scene.world, context.scene, context.view_layer)
    for source in owners:
        if source is not None:
            for name, value in _numbers(source).items():
                owner[name] = value


def _numbers(owner: bpy.types.bpy_struct) -> dict[str, Any]:
    """Return the custom properties that are numbers or arrays of numbers."""
    registered = owner.bl_rna.properties.keys()
    found = {name: value for name, value in owner.items() if name not in registered}
    arrays = {name: list(value) for name, value in found.items() if hasattr(value, "typecode")}
    return arrays | {name: value for name, value in found.items() if isinstance(value, int | float)}
