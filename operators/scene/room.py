"""Box inside the outer walls of the objects that a bake lights."""

from __future__ import annotations

import numpy as np

from ...engine.scene.inner_box import inner_box
from .objects.evaluation import Evaluation, evaluate
from .objects.instancing import visible_meshes
from .objects.items import SceneItem
from .objects.meshes import read_array, read_positions
from .objects.visible import visible_objects
from .scene_context import SceneContext


def room_of(context: SceneContext) -> np.ndarray | None:
    """Return the corners of the box inside outer walls, (2, 3) float64, world space; None without faces.

    Objects and instances with a lightmap count. Raises SceneError as `evaluate`.
    """
    wanted = {obj.session_uid for obj in visible_meshes(context)}
    visible = {obj.session_uid for obj in visible_objects(context)}

    def triangles(evaluation: Evaluation) -> list[np.ndarray]:
        # Geometry Nodes may also make points and curves of a mesh object.
        return [
            _world_triangles(item)
            for item in evaluation.items(visible)
            if item.source.session_uid in wanted and item.object.type == "MESH"
        ]

    found = [part for part in evaluate(context, triangles) if len(part)] if wanted else []
    return inner_box(np.concatenate(found)) if found else None


def _world_triangles(item: SceneItem) -> np.ndarray:
    """Return the triangles of an object or instance, (t, 3, 3), world space, that are finite."""
    mesh, matrix = item.object.data, item.matrix
    mesh.calc_loop_triangles()
    corners = read_array(mesh.loop_triangles, "vertices", 3, np.int32)
    positions = read_positions(mesh) @ matrix[:3, :3].T + matrix[:3, 3]
    found = positions[corners[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else corners]
    return found[np.isfinite(found).all(axis=(1, 2))]
