"""The lightmaps that a bake ends with: fitted to their display, with hidden texels and gutters filled."""

from __future__ import annotations

import numpy as np

from ..patches.seams import Seams
from .bilinear_fit import BilinearFit
from .dilation import Dilation, grown
from .lightmap_points import LightmapPoints
from .smooth_fill import SmoothFill

#: Rings around what the fit knows that show nothing but the nearest chart: a look-up there reads them.
_RINGS = 2


class DisplayFit:
    """Lightmaps of the user's from the light at points.

    points     those that count
    seams      between charts
    has_patch  (atlases, r, r) bool, texels that are patches: those that nobody sees are filled
    dilation   how far charts are extended, texels
    """

    def __init__(self, points: LightmapPoints, seams: Seams, has_patch: np.ndarray, dilation: int) -> None:
        atlases, resolution, _ = has_patch.shape
        self._fit = BilinearFit(resolution, atlases, points, seams)
        self._fills = [
            _fills(known, texels, dilation) for known, texels in zip(self._fit.known, has_patch, strict=True)
        ]

    def images(self, values: np.ndarray) -> np.ndarray:
        """Return lightmaps of the points' light, (s, 3) or (s,) float32, as (atlases, r, r, 3) float32."""
        images = self._fit.images(values if values.ndim == 2 else values[:, None])
        for fills, image in zip(self._fills, images, strict=True):
            for fill in fills:
                fill.fill(image)
        return np.ascontiguousarray(np.broadcast_to(images, (*images.shape[:3], 3)))


def _fills(known: np.ndarray, has_patch: np.ndarray, dilation: int) -> tuple[Dilation, SmoothFill]:
    """Return what fills an atlas around its known texels, (r, r) bool."""
    rings = min(_RINGS, dilation)
    near = known
    for _ in range(rings):
        near = grown(near)
    extended = near
    for _ in range(dilation - rings):
        extended = grown(extended)
    return Dilation(known, rings), SmoothFill(near, has_patch | extended)
