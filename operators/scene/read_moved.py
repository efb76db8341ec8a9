"""A scene that has been read before, with its objects where the viewport has them now."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace

import bpy
import numpy as np

from ...engine.errors import SceneError
from ...engine.scene.model import Mesh
from ...engine.scene.scene_changes import transformed as moved_mesh
from .read import ReadScene
from .scene_context import SceneContext


def read_moved(context: SceneContext, read: ReadScene, moved: Set[int]) -> ReadScene | None:
    """Return a scene in which objects have moved, given their session uids; their meshes stay.

    None if more than the meshes of these objects may have changed: an instancer moves its instances.
    """
    context.evaluated_depsgraph_get()
    if any(placed.instancer in moved for placed in read.placed):
        return None
    objects = {obj.session_uid: obj for obj in bpy.data.objects if obj.session_uid in moved}
    meshes, places = list(read.scene.meshes), list(read.placed)
    for number, placed in enumerate(read.placed):
        obj = objects.get(placed.source)
        if placed.instancer is None and obj is not None:
            matrix = np.array(obj.matrix_world, np.float64)
            try:
                meshes[number] = _move(meshes[number], placed.matrix, matrix, read.scene.origin)
            except (np.linalg.LinAlgError, SceneError):
                return None
            places[number] = replace(placed, matrix=matrix)
    return replace(read, scene=replace(read.scene, meshes=tuple(meshes)), placed=tuple(places))


def _move(mesh: Mesh, before: np.ndarray, after: np.ndarray, origin: np.ndarray) -> Mesh:
    """Return a mesh, whose positions are relative to a point, with another matrix to world space.

    Raises LinAlgError or SceneError if it is flat before or afterwards.
    """
    shift = np.eye(4)
    shift[:3, 3] = origin
    return moved_mesh(mesh, np.linalg.inv(shift) @ after @ np.linalg.inv(before) @ shift)
