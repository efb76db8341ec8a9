"""Progressive refinement: light is shot, the brightest patch first (Cohen et al. 1988), on kept visibility.

All patches ask whether the shooter sees them (Coombe, Harris and Lastra 2004), instead of the shooter's
hemicube being scattered over them.
"""

from __future__ import annotations

import numpy as np

from ..patches.geometry import PatchGeometry
from ..visibility.views.hemicube import face_axes, face_rows
from ..visibility.views.viewpoints import Viewpoints


class Shooting:
    """Radiosity that was shot so far.

    seen         (n, 3 N N) integers, of each patch's hemicube in the stacked layout the patch + 1, or 0
    points       where these hemicubes stand
    polygon      (n,) int, the flat polygon that each patch lies on
    emission     (n, 3) float32, radiance
    reflectance  (n, 3) float32

    irradiance   (n, 3) float64, E/pi that has arrived
    shots        so far
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
        """Flux that has not been shot yet, (3,) float64, W."""
        flux: np.ndarray = np.pi * (self._area[:, None] * self._unshot).sum(axis=0)
        return flux

    @property
    def ambient(self) -> np.ndarray:
        """E/pi that the unshot light would bring if it were everywhere, (3,) float64 (Cohen et al. 1988)."""
        area = self._area.sum()
        mean = (self._area[:, None] * self._reflectance).sum(axis=0) / area
        ambient: np.ndarray = self.unshot / np.pi / area / (1 - mean)
        return ambient

    def shoot(self) -> None:
        """Shoot the light of the patch that has most flux left."""
        shooter = int((self._area * self._unshot.sum(axis=1)).argmax())
        radiance = self._unshot[shooter].copy()
        self._unshot[shooter] = 0
        arriving = self._form_factors(shooter)[:, None] * radiance
        self.irradiance += arriving
        self._unshot += self._reflectance * arriving
        self.shots += 1

    def _form_factors(self, shooter: int) -> np.ndarray:
        """Return how much of a shooter each patch sees, (n,) float64.

        A disk of the shooter's area for a point: A cos cos / (pi r^2 + A) (Wallace et al. 1989).
        """
        line = self._center - self._center[shooter]
        square = np.maximum((line * line).sum(axis=1), 1e-30)
        leaving = line @ self._normal[shooter]
        arriving = -(line * self._normal).sum(axis=1)
        faces = (leaving > 0) & (arriving > 0)
        factor = np.zeros(len(line))
        area = self._area[shooter]
        factor[faces] = area * (leaving * arriving)[faces] / (square * (np.pi * square + area))[faces]

        # Visible is what lies on the polygon that the hemicube shows in its direction.
        texel = texels_of(line[faces], self._axes[shooter], self._width)
        shown = self._polygon[self._seen[shooter, texel].astype(np.int64)]
        factor[faces] *= shown == self._polygon[1:][faces]
        return factor


def texels_of(directions: np.ndarray, axes: np.ndarray, n: int) -> np.ndarray:
    """Return the texel of a hemicube, n wide, that each direction meets, (m,) int64 into the stacked layout.

    directions  (m, 3) float64, any length, above the hemicube's plane
    axes        (5, 3, 3) float64, of `hemicube.face_axes`
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
