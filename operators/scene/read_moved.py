"""Moves objects of a scene that was read before to their present places in the viewport."""

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
    """Return a scene with the objects of the given session uids moved; their meshes are not read again.

    None if other meshes may have moved as well, since an instancer moves its instances.
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
    """Return a mesh, with positions relative to `origin`, transformed from one object matrix to another.

    Raises LinAlgError or SceneError if one of the matrices is singular.
    """
    shift = np.eye(4)
    shift[:3, 3] = origin
    return moved_mesh(mesh, np.linalg.inv(shift) @ after @ np.linalg.inv(before) @ shift)
