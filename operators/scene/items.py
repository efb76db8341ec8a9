"""What a render shows: objects and instances, each with its place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy
import numpy as np

from .visible import visible_objects


@dataclass(frozen=True)
class SceneItem:
    """An object or instance; valid until the iteration over `scene_items` goes on.

    object         evaluated
    source         the original object that is shown
    matrix         (4, 4) float64, object space to world space
    instancer      the original object that makes the instance, None for an object itself
    persistent_id  Blender's number of the instance
    """

    object: bpy.types.Object
    source: bpy.types.Object
    matrix: np.ndarray
    instancer: bpy.types.Object | None
    persistent_id: tuple[int, ...]


def scene_items(context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> Iterator[SceneItem]:
    """Yield what both the viewport and renders show of a view layer, instances included."""
    visible = {obj.session_uid for obj in visible_objects(context)}
    for instance in depsgraph.object_instances:
        parent = instance.parent.original if instance.is_instance else None
        source = instance.object.original
        shown = parent if parent is not None else source
        if shown.session_uid not in visible or (parent is None and not instance.show_self):
            continue
        if source.hide_render:
            continue
        number = tuple(instance.persistent_id) if parent is not None else ()
        yield SceneItem(instance.object, source, np.array(instance.matrix_world, np.float64), parent, number)
