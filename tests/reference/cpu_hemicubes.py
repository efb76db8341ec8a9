"""CPU version of the paper's method: hemicubes traced ray by ray and integrated one by one (V.A)."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from engine.patches.geometry import PatchGeometry
from engine.scene.model import Scene
from engine.scene.triangles import Triangles
from engine.settings import Settings
from engine.visibility.views.hemicube import face_axes, face_rows, multiplier_map
from engine.visibility.views.viewpoints import viewpoints


@dataclass(frozen=True)
class View:
    """Item buffer of a hemicube, by texel of the unfolded layout.

    patch:   (3n, n) int32, patch + 1, or 0 if the lightmap texel has no patch
    facing:  (3n, n) int8, 1 for a front face, -1 for a back face, 0 for the background
    above:   (3n, n) bool, False below the plane of the patch's own surface
    """

    patch: np.ndarray
    facing: np.ndarray
    above: np.ndarray


class CpuHemicubes:
    """Hemicubes of a scene's patches, with the directions, rotations and look-ups of the GPU path.

    texel_to_patch:  (atlases, r, r) uint32 index map: patch + 1, or 0
    emission:        (n, 3) float32, radiance of back faces

    For small scenes only: every ray is tested against every triangle.
    """

    def __init__(
        self,
        scene: Scene,
        triangles: Triangles,
        geometry: PatchGeometry,
        texel_to_patch: np.ndarray,
        emission: np.ndarray,
        settings: Settings,
    ) -> None:
        self._triangles, self._texel_to_patch, self._emission = triangles, texel_to_patch, emission
        self._world = np.append(scene.world, 1).astype(np.float32)
        self._multiplier = multiplier_map(settings.hemicube)
        points = viewpoints(triangles, geometry, settings)
        self._eye, self._axes = points.eye, face_axes(points.frame)
        self._geometric = geometry.geometric
        self._grid = texel_directions(settings.hemicube)

    def view(self, patch: int) -> View:
        """Trace a ray through the centre of every hemicube texel of a patch."""
        axes = self._axes[patch]
        directions = np.concatenate([grid @ face for grid, face in zip(self._grid, axes, strict=True)])
        triangle, uv, front = nearest_hits(self._eye[patch], directions, self._triangles)

        # Look up the lightmap texel of each hit, and its patch.
        resolution = self._texel_to_patch.shape[-1]
        x, y = np.clip((uv * resolution).astype(int), 0, resolution - 1).T
        hit = triangle >= 0
        patch_seen = np.where(hit, self._texel_to_patch[self._triangles.atlas[triangle], y, x], 0)
        shape = self._multiplier.shape
        facing = np.where(hit, np.where(front, 1, -1), 0)
        above = directions @ self._geometric[patch] > 0
        return View(
            patch_seen.astype(np.int32).reshape(shape),
            facing.astype(np.int8).reshape(shape),
            above.reshape(shape),
        )

    def image(self, view: View, radiance: np.ndarray) -> np.ndarray:
        """Return the hemicube image of a view, (3n, n, 4) float32: radiance, and 0 in a for back faces.

        radiance: (n, 3) float32, radiance of each patch
        """
        image = np.zeros((*view.patch.shape, 4), np.float32)
        image[..., 3] = view.facing >= 0
        for facing, values in ((1, radiance), (-1, self._emission)):
            chosen = (view.facing == facing) & (view.patch > 0)
            image[chosen, :3] = values[view.patch[chosen] - 1]
        image[view.facing == 0] = self._world
        return image

    def gather_views(self, views: list[View], radiance: np.ndarray) -> np.ndarray:
        """Return E/pi and the fraction of front faces, (m, 4) float32, one hemicube at a time.

        views:     of m patches
        radiance:  (n, 3) float32, radiance of each patch
        """
        return np.array(
            [integrate(self.image(view, radiance), self._multiplier * view.above) for view in views]
        )

    def gather(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather once for all patches; see `gather.interface.Gather`."""
        views = [self.view(patch) for patch in range(len(self._eye))]
        yield 0.0
        return self.gather_views(views, radiance)


def integrate(image: np.ndarray, multiplier: np.ndarray) -> np.ndarray:
    """Integrate one hemicube in the order of the three kernels (paper, IV.C): multiply, rows, columns.

    image:       (3n, n, 4) float32, unfolded layout
    multiplier:  (3n, n) float32, from `hemicube.multiplier_map`

    Returns the weighted sum, (4,) float32.
    """
    workspace = image.astype(np.float32) * multiplier[..., None]
    row: np.ndarray = workspace[0]
    for texels in workspace[1:]:
        row = row + texels
    while len(row) > 1:
        half = len(row) // 2
        row = row[:half] + row[half:]
    total: np.ndarray = row[0]
    return total


def texel_directions(n: int) -> list[np.ndarray]:
    """Return the centres of each face's texels along the face's axes right, up, forward.

    Returns five (k, 3) float64 arrays, texels row by row; forward is 1.
    """
    along = (np.arange(n) + 0.5) * 2 / n - 1
    grids = []
    for _, rows in face_rows(n):
        up = along[n - rows :]
        x, y = np.meshgrid(along, up)
        grids.append(np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1))
    return grids


def nearest_hits(
    eye: np.ndarray, directions: np.ndarray, triangles: Triangles
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the closest hit of each ray (Moeller and Trumbore 1997).

    eye:         (3,) float64, common origin, metres from `Triangles.origin`
    directions:  (m, 3) float64, world space, any length

    Returns the triangle, (m,) int, -1 for none; lightmap UV, (m, 2) float64; and True for front faces, (m,)
    bool.
    """
    corners = triangles.positions.astype(np.float64)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal, offset = np.cross(first, second), eye - corners[:, 0]

    # Cramer's rule. All rays share one origin, so cross products are computed once per triangle.
    determinant = -(directions @ normal.T)
    inverse = np.divide(1, determinant, out=np.full_like(determinant, np.nan), where=determinant != 0)
    b = -(directions @ np.cross(offset, second).T) * inverse
    c = (directions @ np.cross(offset, first).T) * inverse
    distance = (offset * normal).sum(axis=1) * inverse

    # Select the closest triangle in front of the origin.
    edge = -1e-9
    inside = (b >= edge) & (c >= edge) & (b + c <= 1 - edge) & (distance > 0)
    distance = np.where(inside, distance, np.inf)
    nearest = distance.argmin(axis=1)
    ray = np.arange(len(directions))
    weights = np.stack([1 - b[ray, nearest] - c[ray, nearest], b[ray, nearest], c[ray, nearest]], axis=1)
    hit = inside[ray, nearest]
    uv = np.einsum("mk,mkd->md", np.where(hit[:, None], weights, 0), triangles.uvs[nearest])
    return np.where(hit, nearest, -1), uv, determinant[ray, nearest] > 0
