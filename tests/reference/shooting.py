"""Progressive refinement (Cohen et al. 1988) with cached visibility.

The patch with the most unshot flux shoots first. Each receiver looks itself up in the shooter's hemicube
(Coombe, Harris and Lastra 2004), instead of scattering the hemicube over the patches.
"""

from __future__ import annotations

import numpy as np

from engine.patches.geometry import PatchGeometry
from engine.visibility.views.hemicube import face_axes, face_rows
from engine.visibility.views.viewpoints import Viewpoints


class Shooting:
    """State of progressive refinement.

    seen:         (n, 3 N N) integers, patch + 1 or 0 for each texel of each patch's hemicube, unfolded layout
    points:       viewpoints of these hemicubes
    polygon:      (n,) int, planar polygon of each patch
    emission:     (n, 3) float32, radiance
    reflectance:  (n, 3) float32

    irradiance:  (n, 3) float64, E/pi received so far
    shots:       number of shots so far
    """

    def __init__(
        self,
        geometry: PatchGeometry,
        seen: np.ndarray,
        points: Viewpoints,
        polygon: np.ndarray,
        emission: np.ndarray,
        reflectance: np.ndarray,
    ) -> None:
        self._center, self._normal = geometry.center.astype(np.float64), geometry.normal.astype(np.float64)
        self._area = geometry.area.astype(np.float64)
        self._reflectance = reflectance.astype(np.float64)
        self._seen, self._axes = seen, face_axes(points.frame)
        self._width = round(np.sqrt(seen.shape[1] / 3))
        self._polygon = np.concatenate([[-1], polygon])
        self._unshot = emission.astype(np.float64)
        self.irradiance, self.shots = np.zeros(emission.shape), 0

    @property
    def unshot(self) -> np.ndarray:
        """Flux not yet shot, (3,) float64, W."""
        flux: np.ndarray = np.pi * (self._area[:, None] * self._unshot).sum(axis=0)
        return flux

    @property
    def ambient(self) -> np.ndarray:
        """E/pi of the unshot flux if it were distributed evenly, (3,) float64 (Cohen et al. 1988)."""
        area = self._area.sum()
        mean = (self._area[:, None] * self._reflectance).sum(axis=0) / area
        ambient: np.ndarray = self.unshot / np.pi / area / (1 - mean)
        return ambient

    def shoot(self) -> None:
        """Shoot from the patch with the most unshot flux."""
        shooter = int((self._area * self._unshot.sum(axis=1)).argmax())
        radiance = self._unshot[shooter].copy()
        self._unshot[shooter] = 0
        arriving = self._form_factors(shooter)[:, None] * radiance
        self.irradiance += arriving
        self._unshot += self._reflectance * arriving
        self.shots += 1

    def _form_factors(self, shooter: int) -> np.ndarray:
        """Return the form factor from each patch to the shooter, (n,) float64.

        Disk approximation: A cos cos / (pi r^2 + A) (Wallace et al. 1989).
        """
        line = self._center - self._center[shooter]
        square = np.maximum((line * line).sum(axis=1), 1e-30)
        leaving = line @ self._normal[shooter]
        arriving = -(line * self._normal).sum(axis=1)
        faces = (leaving > 0) & (arriving > 0)
        factor = np.zeros(len(line))
        area = self._area[shooter]
        factor[faces] = area * (leaving * arriving)[faces] / (square * (np.pi * square + area))[faces]

        # A patch is visible if the hemicube shows its polygon in its direction.
        texel = texels_of(line[faces], self._axes[shooter], self._width)
        shown = self._polygon[self._seen[shooter, texel].astype(np.int64)]
        factor[faces] *= shown == self._polygon[1:][faces]
        return factor


def texels_of(directions: np.ndarray, axes: np.ndarray, n: int) -> np.ndarray:
    """Return the texel of an n-wide hemicube that each direction hits, (m,) int64, unfolded layout.

    directions:  (m, 3) float64, any length, above the hemicube's plane
    axes:        (5, 3, 3) float64, from `hemicube.face_axes`
    """
    local = np.einsum("fad,md->fma", axes, directions)
    face = local[:, :, 2].argmax(axis=0)
    right, up, forward = local[face, np.arange(len(directions))].T
    first, rows = np.array(face_rows(n)).T
    x = np.clip((right / forward + 1) / 2 * n, 0, n - 1).astype(np.int64)

    # A side face is the upper half of its square.
    y = np.clip((up / forward + 1) / 2 * n - (n - rows[face]), 0, rows[face] - 1).astype(np.int64)
    texel: np.ndarray = (first[face] + y) * n + x
    return texel
