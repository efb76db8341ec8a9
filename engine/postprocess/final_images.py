"""Final lightmap images: least-squares fit to samples and seams, then fill of invalid texels and gutters."""

from __future__ import annotations

import numpy as np

from ..patches.seams import Seams
from .bilinear_fit import BilinearFit
from .dilation import Dilation, grown
from .lightmap_points import LightmapPoints, centre_points, joined_points
from .membrane_fill import MembraneFill

#: Rings of dilation around fitted texels. Bilinear lookups at chart borders read them, so they take light of
#: the nearest chart only.
RINGS = 2


class FinalImages:
    """Final lightmaps from light at points.

    centres:     (atlases, r, r) bool, texels with a light sample at their centre
    off_centre:  off-centre samples
    seams:       pairs of points on both sides of UV seams
    has_patch:   (atlases, r, r) bool, texels that are patches; invalid ones are filled
    dilation:    distance by which charts are extended, texels
    """

    def __init__(
        self,
        centres: np.ndarray,
        off_centre: LightmapPoints,
        seams: Seams,
        has_patch: np.ndarray,
        dilation: int,
    ) -> None:
        atlases, resolution, _ = has_patch.shape
        self._centre = np.flatnonzero(centres)
        points = joined_points(centre_points(self._centre, resolution), off_centre)
        self._fit = BilinearFit(resolution, atlases, points, seams)
        surface = np.zeros_like(has_patch)
        surface.ravel()[points.texels(resolution)] = True
        self._fills = [
            _fills(*masks, dilation) for masks in zip(self._fit.known, surface, has_patch, strict=True)
        ]

    def images(self, texels: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return the final lightmaps, (atlases, r, r, 3) float32.

        texels:  (atlases, r, r, 3) or (atlases, r, r, 1) float32, light at texel centres
        values:  (s, 3) or (s, 1) float32, light at the off-centre points
        """
        centres = texels.reshape(-1, texels.shape[-1])[self._centre]
        images = self._fit.images(np.concatenate([centres, values]))
        for fills, image in zip(self._fills, images, strict=True):
            for fill in fills:
                fill.fill(image)
        return np.ascontiguousarray(np.broadcast_to(images, (*images.shape[:3], 3)))


def _fills(
    known: np.ndarray, surface: np.ndarray, has_patch: np.ndarray, dilation: int
) -> tuple[Dilation, MembraneFill]:
    """Return the two fills of one atlas.

    known:      (r, r) bool, texels that the fit assigns
    surface:    (r, r) bool, known texels on charts
    has_patch:  (r, r) bool, texels that are patches
    """
    rings = min(RINGS, dilation)
    near = known
    for _ in range(rings):
        near = grown(near)
    extended = near
    for _ in range(dilation - rings):
        extended = grown(extended)
    return Dilation(known, rings, surface), MembraneFill(near, has_patch | extended)
