"""Finds patches that another face covers exactly, as a floor does the underside of a pillar on it."""

from __future__ import annotations

import numpy as np

from .subdivision import Subdivision
from .viewpoints import eye_heights
from .visibility.rays import Rays

#: How far around its surface a patch looks for the other face, in heights of its eye.
_ABOVE, _BELOW = 2.0, 1.0


def covered_patches(rays: Rays, parts: Subdivision) -> np.ndarray:
    """Return which patches, (n,) bool, lie in the plane of another face that shows them its back.

    Nobody sees such a patch, but its hemicube starts beyond the other face and sees what is there.
    """
    geometry = parts.geometry
    height = eye_heights(parts.triangles, geometry)[:, None]
    normal = geometry.geometric.astype(np.float64)
    origins = geometry.center + _ABOVE * height * normal
    hit, _, distance = rays.cast(origins, -(_ABOVE + _BELOW) * height * normal, backs=True)
    covered: np.ndarray = (hit >= 0) & (distance <= 1)
    return covered
