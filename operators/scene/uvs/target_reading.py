"""Reads the meshes to unwrap in short slices, with the charts that they keep and their surface areas."""

from __future__ import annotations

import time
from collections.abc import Generator, Sequence
from dataclasses import replace

import bpy

from ....engine.unwrap.polygon_mesh import PolygonMesh, areas
from ..objects.meshes import read_uvs
from ..objects.visible import visible_objects
from ..scene_context import SceneContext
from ..slice_timer import row_slices
from .known_charts import known_charts
from .object_lookup import ObjectLookup
from .uv_digest import digest_of
from .uv_targets import Leave, UnwrapMesh, Users, own_target
from .wall_cuts import find_wall_edges, walls_of

#: Longest time that areas are measured before control returns to Blender's window, s.
_SLICE = 0.015

#: Floats of working memory that the area of one triangle takes: its corners and temporaries.
_NUMBERS = 27


class TargetReader:
    """Reads the own meshes of objects, without modifiers.

    leave:    called with each object that cannot have lightmap UVs, and the reason
    digests:  digest of the UVs of each mesh that keeps its charts, by the mesh's name
    """

    def __init__(self, context: SceneContext, objects: ObjectLookup, leave: Leave) -> None:
        self._context, self._objects, self._leave = context, objects, leave
        self.digests: dict[str, str] = {}

    def read(self, users: Sequence[Users], keeps_charts: bool) -> Generator[None, None, list[UnwrapMesh]]:
        """Read the mesh of each group of users, with its charts if kept; raises MeshChangedError."""
        targets = []
        for mesh in users:
            yield from self._objects.pause()
            objects = self._objects.of(mesh.uids)
            target = own_target(objects, mesh.layer, self._leave)
            if target is not None:
                if keeps_charts and mesh.layer in objects[0].data.uv_layers:
                    target = self._with_charts(objects[0], target)
                elif objects[0].hemibake.cut_along_walls:
                    target = replace(target, mesh=self._parted(objects[0], target.mesh))
                targets.append(target)
        return targets

    def _with_charts(self, obj: bpy.types.Object, target: UnwrapMesh) -> UnwrapMesh:
        """Return the target with the charts of its present UV layer, and record the digest of the UVs."""
        uvs = read_uvs(obj.data.uv_layers[target.layer])
        self.digests[target.mesh.name] = digest_of(uvs)
        return replace(target, charts=known_charts(target.mesh, uvs))

    def _parted(self, obj: bpy.types.Object, mesh: PolygonMesh) -> PolygonMesh:
        """Return the object's mesh with chart boundaries (field `parted`) at edges on which walls stand."""
        others = [other for other in visible_objects(self._context) if other != obj]
        walls = walls_of(others, self._context.evaluated_depsgraph_get())
        return replace(mesh, parted=find_wall_edges(obj, mesh, walls))


def with_areas(targets: Sequence[UnwrapMesh]) -> Generator[None, None, list[UnwrapMesh]]:
    """Return the targets with measured areas; yields between slices of a few milliseconds."""
    measured, began = [], time.perf_counter()
    for target in targets:
        mesh, area = target.mesh, 0.0
        if target.area > 0:
            measured.append(target)
            continue
        for rows in row_slices(len(mesh.triangles), _NUMBERS):
            if time.perf_counter() - began > _SLICE:
                yield None
                began = time.perf_counter()
            area += float(areas(mesh.positions[mesh.corners[mesh.triangles[rows]]]).sum())
        measured.append(replace(target, area=area))
    return measured
