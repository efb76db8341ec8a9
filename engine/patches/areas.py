"""How much of a surface each patch stands for."""

from __future__ import annotations

import numpy as np

from ..scene.triangles import Triangles
from .geometry import PatchGeometry


def surface_areas(triangles: Triangles, geometry: PatchGeometry) -> np.ndarray:
    """Return the area that each patch stands for, (n,) float32, m^2.

    That is the area of its texel, times what makes all patches of a mesh and a material together as large as
    their triangles: borders of charts cut texels, and texels smaller than a triangle's gap are in no chart.
    """
    kinds = int(triangles.material.max(initial=0)) + 1
    surface = triangles.mesh.astype(np.int64) * kinds + triangles.material
    edges = (triangles.positions[:, 1:] - triangles.positions[:, :1]).astype(np.float64)
    whole = np.bincount(surface, np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2)

    # The texels of each surface, all together.
    of_patch = surface[geometry.triangle]
    texels = np.bincount(of_patch, geometry.area, len(whole))
    scale = np.divide(whole, texels, out=np.ones_like(whole), where=texels > 0)
    areas: np.ndarray = np.minimum(geometry.area * scale[of_patch], np.finfo(np.float32).max)
    return areas.astype(np.float32)
