"""Reads the meshes of a bake as arrays, so that checks can run on them in slices."""

from __future__ import annotations

import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import cached_property

import bpy
import numpy as np

from ..lookup import find_all
from ..result.instance_uv_table import baked_instances
from ..result.moved_charts import has_moved_charts
from ..scene import SceneContext
from ..scene.bake_records import bake_record
from ..scene.objects.evaluation import Evaluation, evaluate
from ..scene.objects.meshes import read_array, read_positions, read_topology, read_uvs
from ..scene.objects.render_differences import Geometry, uses_render
from ..scene.uvs.lightmap_layer import lightmap_layer
from ..scene.uvs.multi_user import multi_user_sources
from ..scene.uvs.uv_modifier import fits, uv_modifier, uv_source
from ..scene.uvs.uv_targets import evaluated_mesh

#: Longest time that meshes are read before control returns to Blender's window, s.
_SLICE = 0.015


@dataclass(frozen=True, eq=False)
class CheckedMesh:
    """An evaluated mesh object.

    several:    True if several objects or instances may share its UVs
    editable:   True if it can get lightmap UVs, because it is not linked from another file
    copies:     True if modifiers make other faces than the mesh has, and no UV modifier stores their UVs
    outdated:   True if a UV modifier stores UVs that no longer fit the faces
    unlike:     True if a UV modifier's UVs fit, but renders and viewport may have different faces
    moved:      True if its lightmap was baked with other lightmap UVs
    matrix:     (4, 4) float64, object space to world space
    scale:      its scale in lightmaps
    positions:  (v, 3) float32, vertex positions in object space
    vertex:     (l,) int32, vertex of each loop
    edge:       (l,) int32, edge from each loop to the next loop of its polygon
    edges:      (e, 2) int32, vertices of each edge
    starts:     (p,) int32, first loop of each polygon
    triangles:  (t, 3) int32, loops of each triangle; see `check_zero_area` for those without area
    uvs:        (l, 2) float32, lightmap UVs; None without fitting ones
    """

    name: str
    uid: int
    atlas: str
    several: bool
    editable: bool
    copies: bool
    outdated: bool
    unlike: bool
    moved: bool
    matrix: np.ndarray
    scale: float
    positions: np.ndarray
    vertex: np.ndarray
    edge: np.ndarray
    edges: np.ndarray
    starts: np.ndarray
    triangles: np.ndarray
    uvs: np.ndarray | None

    @property
    def uvs_of_loops(self) -> np.ndarray:
        """Lightmap UVs, (l, 2) float32, of a mesh that has fitting ones."""
        assert self.uvs is not None
        return self.uvs

    @cached_property
    def is_closed(self) -> bool:
        """True if each edge has two faces."""
        users = np.bincount(self.edge, minlength=len(self.edges))
        return bool((users[users > 0] == 2).all())

    @cached_property
    def corners(self) -> np.ndarray:
        """Positions of the triangles' corners, (t, 3, 3) float32 in object space."""
        return self.positions[self.vertex[self.triangles]]

    @cached_property
    def box(self) -> np.ndarray:
        """Smallest and largest corner of its bounding box, (2, 3) float64 in world space."""
        with np.errstate(invalid="ignore", over="ignore"):
            positions = self.positions @ self.matrix[:3, :3].T + self.matrix[:3, 3]
        return np.stack([positions.min(axis=0), positions.max(axis=0)])


def read_meshes(
    context: SceneContext, objects: Sequence[bpy.types.Object]
) -> Generator[None, None, list[CheckedMesh]]:
    """Return the meshes of the objects that have faces; yields every few milliseconds."""
    waiting = [obj.session_uid for obj in objects]
    uv_layer = context.scene.hemibake.uv_layer
    several = multi_user_sources(uv_layer)
    instanced = {name for _, name, _ in baked_instances(context.scene)}
    geometry = Geometry(context.scene)

    def read(obj: bpy.types.Object, evaluation: Evaluation) -> CheckedMesh | None:
        return _read(obj, evaluation, context.scene, several, instanced, geometry)

    if uses_render(context):
        # All at once, because each evaluation with render settings takes long.
        present = find_all(bpy.data.objects, waiting)
        found = evaluate(context, lambda evaluation: [read(obj, evaluation) for obj in present])
        yield
        return [mesh for mesh in found if mesh is not None]
    meshes: list[CheckedMesh] = []
    while waiting:
        evaluation = Evaluation(context.evaluated_depsgraph_get())
        limit = time.perf_counter() + _SLICE
        present = find_all(bpy.data.objects, waiting)
        done = 0
        for obj in present:
            mesh = read(obj, evaluation)
            meshes += [mesh] if mesh is not None else []
            done += 1
            if time.perf_counter() > limit:
                break
        waiting = [obj.session_uid for obj in present[done:]]
        yield
    return meshes


def _read(
    obj: bpy.types.Object,
    evaluation: Evaluation,
    scene: bpy.types.Scene,
    several: set[int],
    instanced: set[str],
    geometry: Geometry,
) -> CheckedMesh | None:
    """Return the evaluated mesh of an object; None without faces.

    instanced:  names of objects whose instances have a lightmap
    """
    uv_layer = scene.hemibake.uv_layer
    is_lit = bake_record(obj, scene).image is not None or obj.name in instanced
    layer, keeper = lightmap_layer(obj, uv_layer), uv_modifier(obj, uv_layer)
    with evaluated_mesh(obj, evaluation) as mesh:
        if mesh is None or not len(mesh.polygons):
            return None
        mesh.calc_loop_triangles()
        changed = (len(mesh.polygons), len(mesh.loops)) != (len(obj.data.polygons), len(obj.data.loops))
        outdated = keeper is not None and not fits(keeper, mesh)
        uvs = None if outdated else mesh.uv_layers.get(layer)
        vertex, edge, edges = read_topology(mesh)
        return CheckedMesh(
            name=obj.name,
            uid=obj.session_uid,
            atlas=obj.hemibake.atlas,
            several=uv_source(obj, uv_layer) in several,
            editable=bool(obj.is_editable),
            copies=changed and not obj.data.is_editmode and keeper is None,
            outdated=outdated,
            unlike=keeper is not None and not outdated and geometry.differs(obj),
            moved=is_lit and has_moved_charts(obj, mesh, scene),
            matrix=np.array(obj.matrix_world, np.float64),
            scale=obj.hemibake.lightmap_scale,
            positions=read_positions(mesh),
            vertex=vertex,
            edge=edge,
            edges=edges,
            starts=read_array(mesh.polygons, "loop_start", 1, np.int32)[:, 0],
            triangles=read_array(mesh.loop_triangles, "loops", 3, np.int32),
            uvs=None if uvs is None else read_uvs(uvs),
        )
