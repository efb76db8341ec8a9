"""Viewpoints of hemicubes: slightly above their patches, with a random rotation and a horizon."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...device.device_struct import DeviceStruct
from ...patches.geometry import PatchGeometry
from ...scene.triangles import Triangles
from ...settings import Settings
from .hemicube import frames, rotations

#: Height of a viewpoint above its surface, as a fraction of the texel width and, as an upper limit, of the
#: scene's diagonal. The lower limit is the float32 resolution of the patch's coordinates.
OF_TEXEL = 0.01
OF_DIAGONAL = 2e-5
OF_COORDINATE = 1e-6

#: Minimum distance of the near plane, relative to the scene's diagonal. float32 clipping must separate it
#: from the corners of the largest triangles. The standard depth range needs a larger distance.
_NEAR = 1e-6
_NEAR_STANDARD_DEPTH = 1e-5

#: Orientation of a hemicube.
FRAME = DeviceStruct(
    "Frame",
    ("float[3]", "right", "unit, world space"),
    ("float[3]", "up", "unit, world space"),
    ("float[3]", "normal", "unit, world space: the axis of the top face"),
    ("float[3]", "horizon", "unit, along right, up and normal: behind its plane nothing is seen"),
)


@dataclass(frozen=True)
class Viewpoints:
    """Positions and orientations of n hemicubes.

    eye:      (n, 3) float64, metres from `Triangles.origin`
    frame:    (n, 3, 3) float64, rows right, up, normal, from `hemicube.frames`
    near:     (n,) float64, distance of the near plane, metres
    horizon:  (n, 3) float32, geometric normal along right, up, normal; nothing is visible behind its plane
    """

    eye: np.ndarray
    frame: np.ndarray
    near: np.ndarray
    horizon: np.ndarray

    @property
    def frames(self) -> np.ndarray:
        """Frame and horizon, (n, 4, 3) float32, in the layout of the integrators."""
        return np.concatenate([self.frame, self.horizon[:, None]], axis=1, dtype=np.float32)


def frame_records(frames: np.ndarray) -> np.ndarray:
    """Return `Viewpoints.frames`, (m, 4, 3) float32, as (m,) FRAME."""
    records: np.ndarray = frames.reshape(len(frames), -1).view(FRAME.dtype)[:, 0]
    return records


def eye_heights(triangles: Triangles, geometry: PatchGeometry) -> np.ndarray:
    """Return the height of each patch's viewpoint above its surface, (n,) float64, metres."""
    height = np.minimum(OF_TEXEL * np.sqrt(geometry.area), OF_DIAGONAL * triangles.diagonal)
    center = geometry.center.astype(np.float64)
    coordinate = np.maximum(np.abs(center), np.abs(center + triangles.origin)).max(axis=1)
    heights: np.ndarray = np.maximum(height, OF_COORDINATE * coordinate)
    return heights


def viewpoints(
    triangles: Triangles,
    geometry: PatchGeometry,
    settings: Settings,
    reversed_depth: bool = True,
    first: int = 0,
) -> Viewpoints:
    """Return a viewpoint above each patch, with the same rotation in every iteration (paper, IV.B).

    geometry: of patches `first`, `first` + 1, ..., all or a part of them
    """
    diagonal = triangles.diagonal
    center = geometry.center.astype(np.float64)
    height = eye_heights(triangles, geometry)
    near = np.maximum(height / 2, (_NEAR if reversed_depth else _NEAR_STANDARD_DEPTH) * diagonal)

    angle = rotations(settings.seed, first + np.arange(len(center)))
    frame = frames(geometry.normal, angle if settings.rotate else np.zeros(len(center)))
    return Viewpoints(
        eye=center + height[:, None] * geometry.geometric,
        frame=frame,
        near=near,
        horizon=np.einsum("nij,nj->ni", frame, geometry.geometric).astype(np.float32),
    )
