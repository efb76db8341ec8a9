"""Where patches are: centre, normals, texel steps, from their barycentric coordinates."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from .patches import PatchList
from .scene import Scene


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
        points = self.positions.reshape(-1, 3)
        return np.stack([points.min(axis=0), points.max(axis=0)]).astype(np.float64)

    @property
    def middle(self) -> np.ndarray:
        """The middle of the box, (3,) float64, metres: float32 positions relative to it are finest."""
        middle: np.ndarray = self.box.mean(axis=0)
        return middle

    @property
    def diagonal(self) -> float:
        """Length of the box's diagonal, metres."""
        return float(np.linalg.norm(self.box[1] - self.box[0]))


@dataclass(frozen=True)
class PatchGeometry:
    """World-space geometry of each patch.

    triangle   (n,) int32, index into `Triangles`
    center     (n, 3) float32, metres
    normal     (n, 3) float32, unit shading normal
    geometric  (n, 3) float32, unit geometric normal
    edge_u     (n, 3) float32, metres, step of one texel along u
    edge_v     (n, 3) float32, metres, step of one texel along v
    area       (n,) float32, m^2, of one texel
    material   (n,) int32
    """

    triangle: np.ndarray
    center: np.ndarray
    normal: np.ndarray
    geometric: np.ndarray
    edge_u: np.ndarray
    edge_v: np.ndarray
    area: np.ndarray
    material: np.ndarray

    def part(self, first: int, last: int) -> PatchGeometry:
        """Return the geometry of the patches first ... last."""
        return PatchGeometry(**{field.name: getattr(self, field.name)[first:last] for field in fields(self)})


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
    """Place every patch in the world (paper, III.A: positions and normals weighed by barycentrics)."""
    triangle = patch_triangles(scene, patches)
    positions, weights = triangles.positions[triangle], patches.barycentric
    normal = np.einsum("nk,nkd->nd", weights, triangles.normals[triangle])
    edge_u, edge_v, geometric = texel_steps(positions, triangles.uvs[triangle], patches.resolution)
    return PatchGeometry(
        triangle,
        np.einsum("nk,nkd->nd", weights, positions),
        _unit(normal, geometric),
        geometric,
        edge_u,
        edge_v,
        np.linalg.norm(np.cross(edge_u, edge_v), axis=1),
        triangles.material[triangle],
    )


def patch_triangles(scene: Scene, patches: PatchList) -> np.ndarray:
    """Return the index into `Triangles` of each patch, (n,) int32, from mesh, face and subface."""
    triangle = np.empty(len(patches), np.int32)
    order = np.argsort(patches.mesh, kind="stable")
    ends = np.searchsorted(patches.mesh[order], np.arange(len(scene.meshes) + 1))
    first = 0
    for index, mesh in enumerate(scene.meshes):
        chosen = order[ends[index] : ends[index + 1]]
        if len(chosen):
            keys = _triangle_keys(mesh.face, mesh.subface)
            wanted = _triangle_keys(patches.face[chosen], patches.subface[chosen])
            triangle[chosen] = first + np.searchsorted(keys, wanted)
        first += len(mesh.positions)
    return triangle


def _triangle_keys(face: np.ndarray, subface: np.ndarray) -> np.ndarray:
    """One ascending integer for each (face, subface) pair."""
    keys: np.ndarray = (face.astype(np.int64) << 32) + subface
    return keys


def texel_steps(
    positions: np.ndarray, uvs: np.ndarray, resolution: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the world-space steps of one texel along u and v, and the unit geometric normal.

    positions: (n, 3, 3) world space; uvs: (n, 3, 2). Returns three (n, 3) float32 arrays.
    """
    first, second = (positions[:, 1] - positions[:, 0]), (positions[:, 2] - positions[:, 0])
    (u1, v1), (u2, v2) = (uvs[:, 1] - uvs[:, 0]).T * resolution, (uvs[:, 2] - uvs[:, 0]).T * resolution
    determinant = u1 * v2 - u2 * v1
    scale = np.where(np.abs(determinant) > 1e-12, 1.0 / np.where(determinant == 0, 1, determinant), 0.0)[
        :, None
    ]
    edge_u = (v2[:, None] * first - v1[:, None] * second) * scale
    edge_v = (u1[:, None] * second - u2[:, None] * first) * scale
    normal = np.cross(first, second)
    return (
        edge_u.astype(np.float32),
        edge_v.astype(np.float32),
        _unit(normal, np.array([[0.0, 0.0, 1.0]])).astype(np.float32),
    )


def _unit(vectors: np.ndarray, fallback: np.ndarray) -> np.ndarray:
    """Scale vectors to length 1; the fallback stands in for those without a direction."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    unit: np.ndarray = np.where(length > 1e-20, vectors / np.maximum(length, 1e-20), fallback).astype(
        np.float32
    )
    return unit
