"""Where patches are: centre, normals, texel steps, from their barycentric coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..scene.model import Scene
from .patch_list import PatchList

#: Triangles of which the middle of a scene is taken, about.
_SAMPLE = 1 << 12


@dataclass(frozen=True)
class Triangles:
    """All triangles of a scene in one array, mesh after mesh.

    positions  (t, 3, 3) float32, world space, metres
    normals    (t, 3, 3) float32, shading normals of the corners
    uvs        (t, 3, 2) float32, lightmap UV
    material   (t,) int32
    mesh       (t,) int32
    atlas      (t,) int32
    """

    positions: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray
    material: np.ndarray
    mesh: np.ndarray
    atlas: np.ndarray

    @cached_property
    def box(self) -> np.ndarray:
        """Low and high corner of all triangles together, (2, 3) float64, metres."""
        axes = self.positions.reshape(-1, 3).T
        return np.array([[axis.min() for axis in axes], [axis.max() for axis in axes]], np.float64)

    @property
    def middle(self) -> np.ndarray:
        """The median of corners, (3,) float64 that float32 holds: positions relative to it are finest.

        The middle of the box would take the digits from all that lies far from a few distant triangles.
        """
        sample = self.positions[:: max(1, len(self.positions) // _SAMPLE)].reshape(-1, 3)
        middle: np.ndarray = np.median(sample, axis=0).astype(np.float32).astype(np.float64)
        return middle

    @property
    def diagonal(self) -> float:
        """Length of the box's diagonal, metres."""
        return float(np.linalg.norm(self.box[1] - self.box[0]))


@dataclass(frozen=True)
class TexelSteps:
    """What a texel of each triangle's chart is in the world.

    edge_u     (t, 3) float32, metres, step of one texel along u
    edge_v     (t, 3) float32, metres, step of one texel along v
    geometric  (t, 3) float32, unit geometric normal
    area       (t,) float32, m^2, of one texel
    """

    edge_u: np.ndarray
    edge_v: np.ndarray
    geometric: np.ndarray
    area: np.ndarray


class PatchGeometry:
    """World-space geometry of each patch, computed when it is first asked for.

    triangles    of the scene
    steps        of its texels
    triangle     (n,) int32, index into `triangles`
    barycentric  (n, 3) float32, where the patch is on its triangle
    """

    def __init__(
        self, triangles: Triangles, steps: TexelSteps, triangle: np.ndarray, barycentric: np.ndarray
    ) -> None:
        self.triangles, self.steps = triangles, steps
        self.triangle, self.barycentric = triangle, barycentric

    def part(self, chosen: slice | np.ndarray) -> PatchGeometry:
        """Return the geometry of some patches."""
        return PatchGeometry(self.triangles, self.steps, self.triangle[chosen], self.barycentric[chosen])

    @cached_property
    def center(self) -> np.ndarray:
        """Centre, (n, 3) float32, metres (paper, III.A: positions weighed by barycentrics)."""
        center: np.ndarray = np.einsum(
            "nk,nkd->nd", self.barycentric, self.triangles.positions[self.triangle]
        )
        return center

    @cached_property
    def normal(self) -> np.ndarray:
        """Unit shading normal, (n, 3) float32 (paper, III.A)."""
        normal = np.einsum("nk,nkd->nd", self.barycentric, self.triangles.normals[self.triangle])
        return _unit(normal, self.geometric)

    @cached_property
    def geometric(self) -> np.ndarray:
        """Unit geometric normal, (n, 3) float32."""
        geometric: np.ndarray = self.steps.geometric[self.triangle]
        return geometric

    @cached_property
    def edge_u(self) -> np.ndarray:
        """Step of one texel along u, (n, 3) float32, metres."""
        edge: np.ndarray = self.steps.edge_u[self.triangle]
        return edge

    @cached_property
    def edge_v(self) -> np.ndarray:
        """Step of one texel along v, (n, 3) float32, metres."""
        edge: np.ndarray = self.steps.edge_v[self.triangle]
        return edge

    @cached_property
    def area(self) -> np.ndarray:
        """Area of one texel, (n,) float32, m^2."""
        area: np.ndarray = self.steps.area[self.triangle]
        return area

    @cached_property
    def material(self) -> np.ndarray:
        """Material, (n,) int32."""
        material: np.ndarray = self.triangles.material[self.triangle]
        return material


def gather_triangles(scene: Scene) -> Triangles:
    """Join the meshes of a scene."""
    counts = [len(mesh.positions) for mesh in scene.meshes]
    return Triangles(
        np.concatenate([mesh.positions for mesh in scene.meshes]).astype(np.float32),
        np.concatenate([mesh.normals for mesh in scene.meshes]).astype(np.float32),
        np.concatenate([mesh.uvs for mesh in scene.meshes]).astype(np.float32),
        np.concatenate([mesh.material for mesh in scene.meshes]).astype(np.int32),
        np.repeat(np.arange(len(counts), dtype=np.int32), counts),
        np.repeat(np.array([mesh.atlas for mesh in scene.meshes], np.int32), counts),
    )


def patch_geometry(scene: Scene, triangles: Triangles, patches: PatchList) -> PatchGeometry:
    """Place every patch in the world."""
    steps = texel_steps(triangles, patches.resolution)
    return PatchGeometry(triangles, steps, patch_triangles(scene, patches), patches.barycentric)


def patch_triangles(scene: Scene, patches: PatchList) -> np.ndarray:
    """Return the index into `Triangles` of each patch, (n,) int32, from mesh, face and subface."""
    faces = [int(mesh.face[-1]) + 1 if len(mesh.face) else 0 for mesh in scene.meshes]
    first_face = np.cumsum([0, *faces])
    face = np.concatenate([mesh.face + first for mesh, first in zip(scene.meshes, first_face, strict=False)])
    subface = np.concatenate([mesh.subface for mesh in scene.meshes])

    # A table with room for as many triangles of each polygon as its last one says.
    last = np.flatnonzero(np.diff(face, append=-1))
    room = np.zeros(first_face[-1] + 1, np.int64)
    room[face[last] + 1] = subface[last] + 1
    start = np.cumsum(room)
    table = np.zeros(start[-1], np.int32)
    table[start[face] + subface] = np.arange(len(face))
    return table.take(start.take(first_face.take(patches.mesh) + patches.face) + patches.subface)


def texel_steps(triangles: Triangles, resolution: int) -> TexelSteps:
    """Return what a texel of each triangle's chart is in the world."""
    positions, uvs = triangles.positions, triangles.uvs
    first, second = (positions[:, 1] - positions[:, 0]), (positions[:, 2] - positions[:, 0])
    (u1, v1), (u2, v2) = (uvs[:, 1] - uvs[:, 0]).T * resolution, (uvs[:, 2] - uvs[:, 0]).T * resolution
    determinant = u1 * v2 - u2 * v1
    scale = np.where(np.abs(determinant) > 1e-12, 1.0 / np.where(determinant == 0, 1, determinant), 0.0)[
        :, None
    ]
    edge_u = ((v2[:, None] * first - v1[:, None] * second) * scale).astype(np.float32)
    edge_v = ((u1[:, None] * second - u2[:, None] * first) * scale).astype(np.float32)
    geometric = _unit(np.cross(first, second), np.array([[0.0, 0.0, 1.0]]))
    area = np.linalg.norm(np.cross(edge_u, edge_v), axis=1)
    return TexelSteps(edge_u, edge_v, geometric, area)


def _unit(vectors: np.ndarray, fallback: np.ndarray) -> np.ndarray:
    """Scale vectors to length 1; the fallback stands in for those without a direction."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    unit: np.ndarray = np.where(length > 1e-20, vectors / np.maximum(length, 1e-20), fallback).astype(
        np.float32
    )
    return unit
