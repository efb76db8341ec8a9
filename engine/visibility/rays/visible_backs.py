"""Visible back faces: test rays from all surfaces find the back faces whose light reaches a surface.

Back faces that no ray hits, such as the outer sides of a room's walls, need no patches. Nor do back faces
that are visible only from points inside geometry, such as the inner sides of a bottomless box on a floor.
Rays have random origins and cosine-distributed directions, like visibility samples. Back faces missed by all
N rays cover at most 3 / N of all views with a probability of 95 % (rule of three, Hanley and Lippman-Hand
1983).
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Generator
from functools import partial
from typing import TypeVar

import numpy as np

from ...array_ops import map_blocks
from ...device.buffers import download_bytes, lasting_buffer, upload, words_of, zeros
from ...device.cpu_renderers import draws_on_cpu
from ...device.opencl import cl
from ...patches.unmapped_meshes import COARSENESS, clusters, triangle_areas
from ...progress import finished
from ...scene.cutouts import Cutouts, read_cutouts
from ...scene.digests import same_values
from ...scene.model import Scene
from ...scene.triangles import Triangles, join_meshes
from ..views.viewpoints import OF_COORDINATE, OF_DIAGONAL, OF_TEXEL
from .back_rays import BackRays, CastRays, marks_of
from .bvh import Bvh
from .ray_tracer import RayTracer
from .receiver_records import RECEIVER
from .shaders.host_bvh import HostBvh
from .shaders.shader_back_rays import ShaderBackRays
from .shaders.shader_tables import storage_buffer
from .shaders.shader_tracer import ShaderTracer

#: Function that creates the ray tracer of triangles on the device of a bake.
MakeTracer = Callable[[Triangles, Cutouts], RayTracer | ShaderTracer]

#: BVH on a device with or without OpenCL.
Hierarchy = TypeVar("Hierarchy", Bvh, HostBvh)

#: Rays per texel of a lightmap, and per coarse texel of a back face. Back faces missed by four rays cover
#: less than the view of one texel, see above.
_RAYS = 4

#: Minimum number of rays of one round, from front faces and from back faces (chosen).
_MIN_RAYS = 1 << 11

#: Maximum number of rays of one round (chosen); ray numbers are uint32. A CPU casts the maximum in a few
#: seconds, so larger scenes have fewer rays per texel. A GPU reaches the maximum at 268 million texels.
_MAX_RAYS_CPU, _MAX_RAYS_GPU = 1 << 22, 1 << 30

#: Number of rays of one launch, so that a launch is short on a CPU and on a slow GPU (chosen). Sizes that
#: depend on time would change the kernels that are built ahead.
_LAUNCH_CPU, _LAUNCH_GPU = 1 << 18, 1 << 22

#: Maximum number of rounds: rays from front faces, and from the back faces that the round before found. Each
#: round finds more of the inside of a vase, or 28 m more of the underside of a roof 5 m above a floor.
_ROUNDS = 8

#: Width of a cluster of small triangles of one direction, texels: all are visible if one of them is.
_CLUSTER = 4.0


class VisibleBacks:
    """Visible back faces of successive scenes; the choice is cached while the geometry is unchanged."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Drop the cached choice."""
        self._key: tuple = ()
        self._shape: tuple = ()
        self._visible = np.zeros(0, bool)
        self._unchecked: tuple[Scene, np.ndarray, float, int] | None = None
        self._hierarchy: tuple[tuple[np.ndarray, ...], np.ndarray, Bvh | HostBvh] | None = None

    def of(
        self,
        make_tracer: MakeTracer,
        scene: Scene,
        candidates: np.ndarray,
        texel: float,
        resolution: int,
        is_moving: bool = False,
    ) -> np.ndarray:
        """Return the result of `find` at once; parameters as there."""
        return finished(self.find(make_tracer, scene, candidates, texel, resolution, is_moving))

    def find(
        self,
        make_tracer: MakeTracer,
        scene: Scene,
        candidates: np.ndarray,
        texel: float,
        resolution: int,
        is_moving: bool = False,
    ) -> Generator[None, None, np.ndarray]:
        """Return a mask of the candidates with a visible back face, (t,) bool; yield between launches.

        scene:       occluders must have lightmap UVs already
        candidates:  (t,) bool, of all triangles
        texel:       mean world size of a lightmap texel, m; 0 if nothing has a lightmap
        is_moving:   True to keep the last choice while meshes move, so that patches stay; see `refresh`
        """
        if not candidates.any():
            self.clear()
            return candidates
        key = (_key_of(scene), texel, resolution, candidates)
        shape = resolution, tuple(len(mesh.positions) for mesh in scene.meshes)
        self._unchecked = None
        if same_values(key, self._key):
            return self._visible
        if is_moving and shape == self._shape:
            self._unchecked = scene, candidates, texel, resolution
            return self._visible & candidates
        triangles = join_meshes(scene)
        tracer = make_tracer(triangles, read_cutouts(scene))
        width = texel or triangles.diagonal / resolution
        self._visible = yield from _visible(tracer, triangles, scene, width, resolution, candidates)
        self._key, self._shape = key, shape
        self._hierarchy = _positions_of(scene), triangles.origin, tracer.bvh
        return self._visible

    def refresh(self, make_tracer: MakeTracer) -> bool:
        """Repeat the choice if the last one was kept while meshes moved; return True if it changes."""
        if self._unchecked is None:
            return False
        scene, candidates, texel, resolution = self._unchecked
        used = self._visible & candidates
        return not np.array_equal(self.of(make_tracer, scene, candidates, texel, resolution), used)

    def bvh_of(self, scene: Scene, origin: np.ndarray, kind: type[Hierarchy]) -> Hierarchy | None:
        """Return the BVH of the last choice if it has the same triangles and is of this kind; else None.

        scene:   scene whose meshes of front faces must have the arrays of the choice
        origin:  `Triangles.origin` of the scene

        It is returned only once, so that its buffers live no longer than the bake needs them.
        """
        if self._hierarchy is None:
            return None
        positions, before, bvh = self._hierarchy
        others = _positions_of(scene)
        is_same = len(positions) == len(others) and all(map(operator.is_, positions, others))
        if not is_same or not np.array_equal(before, origin) or not isinstance(bvh, kind):
            return None
        self._hierarchy = None
        return bvh


def _positions_of(scene: Scene) -> tuple[np.ndarray, ...]:
    """Return the positions of the meshes that are no back faces."""
    return tuple(mesh.positions for mesh in scene.meshes if mesh.front is None)


def _key_of(scene: Scene) -> tuple:
    """Return a key of everything that determines which back faces of a scene are visible."""
    meshes = tuple(
        (mesh.positions, mesh.uvs, mesh.material, mesh.atlas, mesh.texture_uvs) for mesh in scene.meshes
    )
    return meshes, tuple(material.transmission for material in scene.materials), _stays(scene)


def _stays(scene: Scene) -> np.ndarray:
    """Return a mask of materials whose back faces always have patches, (m,) bool."""
    return np.array([material.translucent for material in scene.materials], bool)


def _visible(
    tracer: RayTracer | ShaderTracer,
    triangles: Triangles,
    scene: Scene,
    texel: float,
    resolution: int,
    candidates: np.ndarray,
) -> Generator[None, None, np.ndarray]:
    """Return the result of `VisibleBacks.find`; yield between launches.

    tracer: ray tracer of the triangles; texel: world size of a lightmap texel, m, not 0
    """
    height = max(
        min(OF_TEXEL * texel, OF_DIAGONAL * triangles.diagonal),
        OF_COORDINATE * float(np.abs([triangles.box, triangles.box + triangles.origin]).max()),
    )
    visible = np.zeros(len(candidates), bool)
    area = triangle_areas(triangles.positions) / (COARSENESS * texel) ** 2
    chosen = np.flatnonzero(candidates)

    # Number 0 contains all triangles that are no candidates.
    cluster = np.zeros(len(candidates), np.int32)
    number = clusters(triangles, chosen, _CLUSTER * texel) + 1
    cluster[chosen] = number
    hit_backs = np.zeros(int(number.max(initial=0)) + 1, bool)
    rays_from = _ray_maker(tracer, triangles.positions, height)
    fronts = rays_from(_texels(triangles, resolution), 1.0, None)
    backs: list[CastRays] = []
    more, stays = np.zeros(0, np.int64), _stays(scene)
    if stays.any():
        more, changes = np.flatnonzero(stays[triangles.material]), ~stays[triangles.material[chosen]]
        chosen, number = chosen[changes], number[changes]
    for _ in range(_ROUNDS):
        hit_backs[:] = False
        for rays in (*fronts, *backs):
            hits = yield from rays.hit_backs(visible)
            hit_backs[cluster[np.flatnonzero(hits)]] = True
        hit_backs[0] = False
        if hit_backs.any():
            # Candidates are left while their cluster has not been hit.
            is_hit = hit_backs[number]
            more = np.union1d(more, chosen[is_hit]) if len(more) else chosen[is_hit]
            chosen, number = chosen[~is_hit], number[~is_hit]
        if not len(more):
            break
        visible[more] = True
        weight = np.zeros_like(area)
        weight[more] = area[more]
        backs, more = rays_from(weight, -1.0, more), more[:0]
    return visible & candidates


def _ray_maker(
    tracer: RayTracer | ShaderTracer, positions: np.ndarray, height: float
) -> Callable[[np.ndarray, float, np.ndarray | None], list[CastRays]]:
    """Return a function of the texels of triangles, (t,), a side, and `starting` as in `BackRays.of`.

    It returns rays that start on this side of the triangles, none without texels.

    positions:  (t, 3, 3) float32, m
    height:     of ray origins above the surface, m
    """
    cast, max_rays = _caster(tracer, positions), _max_rays(tracer)

    def rays_from(weight: np.ndarray, side: float, starting: np.ndarray | None) -> list[CastRays]:
        total = weight.sum()
        if not total:
            return []
        count = int(np.clip(_RAYS * total, _MIN_RAYS, max_rays))
        return [cast(BackRays.of(weight, count, side, height, starting))]

    return rays_from


def _max_rays(tracer: RayTracer | ShaderTracer) -> int:
    """Return the maximum number of rays of one round on the device of a ray tracer."""
    if isinstance(tracer, ShaderTracer):
        on_cpu = draws_on_cpu(tracer.graphics.name)
    else:
        on_cpu = tracer.compute.processor
    return _MAX_RAYS_CPU if on_cpu else _MAX_RAYS_GPU


def _caster(tracer: RayTracer | ShaderTracer, positions: np.ndarray) -> Callable[[BackRays], CastRays]:
    """Return a function that puts rays on the device of a ray tracer.

    positions: (t, 3, 3) float32, m, uploaded once for all rounds
    """
    if isinstance(tracer, ShaderTracer):
        return partial(ShaderBackRays, tracer, storage_buffer(tracer.graphics, positions))
    return partial(_KernelBackRays, tracer, lasting_buffer(tracer.compute, positions))


class _KernelBackRays:
    """Test rays traced by an OpenCL kernel; see `back_rays.CastRays`."""

    def __init__(self, tracer: RayTracer, corners: cl.Buffer, rays: BackRays) -> None:
        """Upload the rays; corners: (t, 3, 3) float32, m, of all triangles."""
        self._tracer, self._corners, self._rays, self._again = tracer, corners, rays, False
        self._ends = upload(tracer.compute, rays.ends)
        self._enclosed = zeros(tracer.compute, 4 * rays.words)

    def hit_backs(self, known: np.ndarray) -> Generator[None, None, np.ndarray]:
        """Return the result of `CastRays.hit_backs`."""
        triangles, tracer, rays = len(known), self._tracer, self._rays
        compute = tracer.compute
        (kernel,) = tracer.kernels((RECEIVER, "visible_backs.cl"), "mark_visible_backs")
        before = np.zeros(words_of(triangles), np.uint8)
        before[:triangles] = marks_of(known)
        marks = upload(compute, before)
        most = _LAUNCH_CPU if compute.processor else _LAUNCH_GPU
        for first in range(0, rays.count, most):
            count = min(most, rays.count - first)
            tracer.run(
                kernel, count, self._corners, self._ends, np.int32(triangles), np.float32(rays.side),
                np.float32(rays.height), marks, self._enclosed, np.int32(self._again), np.uint32(first),
                np.int32(count),
            )  # fmt: skip
            compute.queue.finish()
            yield
        self._again = True
        return download_bytes(compute, marks, triangles) == 1


def _texels(triangles: Triangles, resolution: int) -> np.ndarray:
    """Return the area of triangles on their lightmaps, (t,) float64, texels."""
    texels = np.empty(len(triangles.uvs))

    def find(rows: slice) -> None:
        uvs = triangles.uvs[rows]
        first, second = ((uvs[:, k] - uvs[:, 0]).astype(np.float64).T for k in (1, 2))
        texels[rows] = np.abs(first[0] * second[1] - first[1] * second[0]) * (resolution**2 / 2)

    map_blocks(len(texels), 32, find)
    return texels
