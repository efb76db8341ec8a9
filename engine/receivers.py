"""Patches as kernels/direct.cl wants them: where they receive light, and where rays start."""

from __future__ import annotations

import numpy as np

from .geometry import PatchGeometry, Triangles
from .patches import PatchList
from .viewpoints import eye_heights

#: float4 a record.
RECORD = 7


def pack_receivers(
    triangles: Triangles, geometry: PatchGeometry, patches: PatchList, origin: np.ndarray
) -> np.ndarray:
    """Return (n, RECORD, 4) float32; positions relative to origin, (3,) float64, metres."""
    corners = triangles.positions[geometry.triangle]
    lift = smooth_lift(corners, triangles.normals[geometry.triangle], patches.barycentric)
    first = corners[:, 0] - origin
    records = np.zeros((len(patches), RECORD, 4), np.float32)
    vectors = (
        geometry.center - origin,
        geometry.normal,
        geometry.geometric,
        geometry.edge_u,
        geometry.edge_v,
        corners[:, 1] - corners[:, 0],
        corners[:, 2] - corners[:, 0],
    )
    for row, vector in enumerate(vectors):
        records[:, row, :3] = vector
    scalars = (eye_heights(triangles, geometry), lift[:, 0], first[:, 2], first[:, 0], first[:, 1])
    for row, scalar in enumerate((*scalars, lift[:, 1], lift[:, 2])):
        records[:, row, 3] = scalar
    return records


def smooth_lift(corners: np.ndarray, normals: np.ndarray, barycentric: np.ndarray) -> np.ndarray:
    """Return how far outside of its flat triangle the smooth surface is at each patch, (n, 3) float64.

    corners, normals: (n, 3, 3) of the patches' triangles; barycentric: (n, 3). The point is projected on
    the planes of the three vertices, outwards only, against the shadow terminator (Hanika 2021).
    """
    corners, normals = corners.astype(np.float64), normals.astype(np.float64)
    point = np.einsum("nk,nkd->nd", barycentric, corners)
    below = np.minimum(np.einsum("nkd,nkd->nk", point[:, None] - corners, normals), 0)
    lift: np.ndarray = -np.einsum("nk,nk,nkd->nd", barycentric, below, normals)
    return lift
