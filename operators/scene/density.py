"""Texel density of surfaces, and the width of lightmaps that a density needs."""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from typing import NamedTuple

import bpy
import numpy as np

from ...engine.scene.model import NO_LIGHTMAP, Scene
from .objects.evaluation import Evaluation
from .objects.meshes import read_array
from .scene_context import SceneContext
from .slice_timer import Slice
from .uvs.lightmap_layer import layer_triangles, lightmap_layer
from .uvs.multi_user import multi_user_sources
from .uvs.uv_modifier import uv_source
from .uvs.uv_targets import evaluated_mesh

#: Expected fraction of a lightmap that packed charts cover (measured: 0.5 to 0.7).
_FILLED = 0.6

#: Widths computed from a density are rounded up to a multiple of this number of texels.
_STEP = 16

#: Texel size, m, of a scene with the surface of a cube of edge _ROOM, m (chosen). For other edges it is
#: scaled by a power of the ratio, _SMALLER below and _LARGER above: 2 cm in a box of 2 m, 5 cm in a house,
#: 10 cm in a level.
_ROOM_TEXEL, _ROOM, _SMALLER, _LARGER = 0.025, 5.0, 1 / 3, 1 / 2

#: Mean number of texels per triangle of scenes with many small triangles, such as models of 0.5 m, and the
#: width up to which such triangles raise the width, texels (chosen).
_TRIANGLE_TEXELS, _DETAILED = 16, 512

_NO_TRIANGLES = np.zeros((0, 3, 2), np.float32)


class ChartArea(NamedTuple):
    """Area that the charts of one lightmap have in the scene and in the lightmap.

    surface:    area of the objects in world space, times the square of their scale in lightmaps, units^2
    covered:    fraction of the lightmap that the charts cover; 0 if they are not packed yet
    triangles:  their number
    """

    surface: float
    covered: float
    triangles: int = 0

    def side(self, lightmaps: int = 1) -> float:
        """Return the length of surface along the width of the lightmap, units.

        lightmaps:  number of lightmaps that charts are spread over, if they are not packed yet
        """
        return math.sqrt(self.surface / self._filled(lightmaps))

    def detailed_width(self, lightmaps: int = 1) -> float:
        """Return the width of the lightmap that gives triangles _TRIANGLE_TEXELS texels on average."""
        return math.sqrt(_TRIANGLE_TEXELS * self.triangles / self._filled(lightmaps))

    def _filled(self, lightmaps: int) -> float:
        """Return the number of lightmaps that the charts fill, a fraction for one lightmap."""
        return self.covered or _FILLED * lightmaps


def expected_areas(
    context: SceneContext, objects: Sequence[bpy.types.Object], uv_layer: str
) -> Generator[None, None, list[ChartArea]]:
    """Return the areas of each lightmap of objects that may have no lightmap UVs yet, in slices.

    The meshes are the viewport's; hidden objects are measured without modifiers. The result is therefore an
    estimate.
    """
    left = [obj.session_uid for obj in objects]
    several = multi_user_sources(uv_layer)
    areas: dict[tuple[str, bool], ChartArea] = {}
    while left:
        evaluation, time = Evaluation(context.evaluated_depsgraph_get()), Slice()
        present = {obj.session_uid: obj for obj in bpy.data.objects}
        while left and not time.over:
            obj = present.get(left.pop())
            if obj is not None:
                _add_object(areas, obj, uv_layer, several, evaluation)
        if left:
            yield
    return list(areas.values())


def _add_object(
    areas: dict[tuple[str, bool], ChartArea],
    obj: bpy.types.Object,
    uv_layer: str,
    several: set[int],
    evaluation: Evaluation,
) -> None:
    """Add an object to the areas, by the name of the lightmap and whether its charts are packed."""
    layer = lightmap_layer(obj, uv_layer)
    with evaluated_mesh(obj, evaluation) as evaluated:
        mesh = evaluated or obj.data
        packed = layer in mesh.uv_layers and uv_source(obj, uv_layer) not in several
        flat = layer_triangles(mesh, layer) if packed else _NO_TRIANGLES
        surface, covered, triangles = areas.get((obj.hemibake.atlas, packed), ChartArea(0.0, 0.0))
        areas[obj.hemibake.atlas, packed] = ChartArea(
            surface + _world_area(obj, mesh) * obj.hemibake.lightmap_scale**2,
            min(covered + _flat_area(flat), _FILLED),
            triangles + len(mesh.loop_triangles),
        )


def areas_of(scene: Scene) -> list[ChartArea]:
    """Return the areas of each lightmap of a scene that was read, except those without charts."""
    areas = []
    for atlas in range(len(scene.atlases)):
        meshes = [mesh for mesh in scene.meshes if mesh.atlas == atlas and mesh.atlas != NO_LIGHTMAP]
        surface = sum(_area(mesh.positions) for mesh in meshes)
        covered = sum(_flat_area(mesh.uvs) for mesh in meshes)
        if covered > 0:
            areas.append(ChartArea(surface, covered, sum(len(mesh.positions) for mesh in meshes)))
    return areas


def longest_side(areas: Sequence[ChartArea], lightmaps: int = 1) -> float:
    """Return the largest length of surface along the width of a lightmap, units; 0 without areas."""
    return max((area.side(lightmaps) for area in areas), default=0.0)


def width_for_density(areas: Sequence[ChartArea], density: float) -> int:
    """Return the width of lightmaps, texels, whose mean density is at least `density` texels per unit."""
    return max(1, math.ceil(longest_side(areas) * density / _STEP)) * _STEP


def needed_width(areas: Sequence[ChartArea], metres_per_unit: float, lightmaps: int) -> float:
    """Return the width of lightmaps that suits the size of a scene, texels; 0 without surface.

    The texel size follows from the surface of the whole scene, so that all its lightmaps have the same
    density. See _ROOM_TEXEL. Small scenes of many triangles need more texels, see _TRIANGLE_TEXELS.
    """
    edge = metres_per_unit * math.sqrt(sum(area.surface for area in areas) / 6)
    if edge == 0:
        return 0.0
    texel = _ROOM_TEXEL * (edge / _ROOM) ** (_SMALLER if edge < _ROOM else _LARGER)
    detailed = max(area.detailed_width(lightmaps) for area in areas)
    return max(longest_side(areas, lightmaps) * metres_per_unit / texel, min(detailed, _DETAILED))


def _world_area(obj: bpy.types.Object, mesh: bpy.types.Mesh) -> float:
    """Return the surface of an evaluated mesh in world space, units^2; 0 if it is not finite."""
    mesh.calc_loop_triangles()
    vertices = read_array(mesh.loop_triangles, "vertices", 3, np.int32)
    positions = read_array(mesh.vertices, "co", 3, np.float32) @ np.array(obj.matrix_world)[:3, :3].T
    area = _area(positions[vertices])
    return area if math.isfinite(area) else 0.0


def _area(corners: np.ndarray) -> float:
    """Return the area of triangles in space, corners (t, 3, 3)."""
    (ax, ay, az), (bx, by, bz) = ((corners[:, k] - corners[:, 0]).T for k in (1, 2))
    normal = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    x, y, z = (part.astype(np.float64) for part in normal)
    return float(np.sqrt(x * x + y * y + z * z).sum()) / 2


def _flat_area(uvs: np.ndarray) -> float:
    """Return the area of triangles in UV space, corners (t, 3, 2)."""
    (u1, v1), (u2, v2) = ((uvs[:, k] - uvs[:, 0]).T.astype(np.float64) for k in (1, 2))
    return float(np.abs(u1 * v2 - u2 * v1).sum()) / 2
