"""How many texels a unit of length gets on surfaces, and how wide lightmaps have to be for it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import bpy
import numpy as np

from ...engine.scene.model import NO_LIGHTMAP, Scene
from .objects.evaluation import Evaluation
from .objects.meshes import read_array
from .scene_context import SceneContext
from .uvs.lightmap_layer import layer_triangles, lightmap_layer
from .uvs.multi_user import multi_user_sources
from .uvs.uv_modifier import uv_source
from .uvs.uv_targets import evaluated_mesh

#: Part of a lightmap that charts are expected to cover once they are packed.
_FILLED = 0.6

#: Widths are multiples of this, texels.
_STEP = 16


_NO_TRIANGLES = np.zeros((0, 3, 2), np.float32)


def width_before(
    context: SceneContext, objects: Sequence[bpy.types.Object], uv_layer: str, density: float
) -> int:
    """Return how wide the lightmaps of objects will have to be, texels, for `density` texels a unit.

    Charts that are there stay, so theirs is known; others are expected to fill a part of a lightmap. The
    meshes are the viewport's, of hidden objects those without modifiers: the result is a first guess.
    """
    several = multi_user_sources(uv_layer)
    evaluation = Evaluation(context.evaluated_depsgraph_get())
    surface: dict[tuple[str, bool], float] = {}
    covered: dict[tuple[str, bool], float] = {}
    for obj in objects:
        layer = lightmap_layer(obj, uv_layer)
        with evaluated_mesh(obj, evaluation) as evaluated:
            mesh = evaluated or obj.data
            packed = layer in mesh.uv_layers and uv_source(obj, uv_layer) not in several
            key, flat = (
                (obj.hemibake.atlas, packed),
                layer_triangles(mesh, layer) if packed else _NO_TRIANGLES,
            )
            surface[key] = surface.get(key, 0.0) + _world_area(obj, mesh) * obj.hemibake.lightmap_scale**2
            covered[key] = covered.get(key, 0.0) + _flat_area(flat)
    filled = {key: min(area or _FILLED, _FILLED) for key, area in covered.items()}
    widths = [density * math.sqrt(area / filled[key]) for key, area in surface.items()]
    return _rounded(max(widths, default=0.0))


def width_of(scene: Scene, density: float) -> int:
    """Return how wide the lightmaps of a scene have to be, texels, for a mean of `density` texels a unit."""
    widths = [0.0]
    for atlas in range(len(scene.atlases)):
        meshes = [mesh for mesh in scene.meshes if mesh.atlas == atlas and mesh.atlas != NO_LIGHTMAP]
        surface = sum(_area(mesh.positions) for mesh in meshes)
        covered = sum(_flat_area(mesh.uvs) for mesh in meshes)
        if covered > 0:
            widths.append(density * math.sqrt(surface / covered))
    return _rounded(max(widths))


def _rounded(width: float) -> int:
    return max(1, math.ceil(width / _STEP)) * _STEP


def _world_area(obj: bpy.types.Object, mesh: bpy.types.Mesh) -> float:
    """Return the surface of an evaluated mesh in world space, m^2."""
    mesh.calc_loop_triangles()
    vertices = read_array(mesh.loop_triangles, "vertices", 3, np.int32)
    positions = read_array(mesh.vertices, "co", 3, np.float32) @ np.array(obj.matrix_world)[:3, :3].T
    area = _area(positions[vertices])
    return area if math.isfinite(area) else 0.0


def _area(corners: np.ndarray) -> float:
    """Return the area of triangles in space, (t, 3, 3)."""
    edges = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(np.linalg.norm(edges.astype(np.float64), axis=1).sum()) / 2


def _flat_area(uvs: np.ndarray) -> float:
    """Return the area of triangles in UV space, (t, 3, 2)."""
    (u1, v1), (u2, v2) = (np.moveaxis(uvs[:, k] - uvs[:, 0], 1, 0).astype(np.float64) for k in (1, 2))
    return float(np.abs(u1 * v2 - u2 * v1).sum()) / 2
