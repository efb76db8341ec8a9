"""All triangles of a scene, mesh after mesh."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .model import Scene

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


def join_meshes(scene: Scene) -> Triangles:
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
