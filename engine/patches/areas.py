"""How much of a surface each patch stands for."""

from __future__ import annotations

import numpy as np

from ..scene.triangles import Triangles
from .geometry import PatchGeometry


def surface_areas(triangles: Triangles, geometry: PatchGeometry, resolution: int) -> np.ndarray:
    """Return the area that each patch stands for, (n,) float32, m^2.

    That is the area of its texel, times what makes all patches of a mesh and a material together as large as
    their triangles: borders of charts cut texels.
    """
    kinds = int(triangles.material.max(initial=0)) + 1
    surface = triangles.mesh.astype(np.int64) * kinds + triangles.material

    # A triangle's texels are of one size: as many as its chart is large, and those that are patches.
    (u1, v1), (u2, v2) = ((triangles.uvs[:, k] - triangles.uvs[:, 0]).T * resolution for k in (1, 2))
    texel = geometry.steps.area.astype(np.float64)
    whole = np.bincount(surface, texel * np.abs(u1 * v2 - u2 * v1) / 2)
    patches = np.bincount(geometry.triangle, minlength=len(surface))
    listed = np.bincount(surface, texel * patches, len(whole))
    scale = np.divide(whole, listed, out=np.ones_like(whole), where=listed > 0)
    areas: np.ndarray = np.minimum(texel * scale[surface], np.finfo(np.float32).max).astype(np.float32)
    return areas[geometry.triangle]
