"""How the patches of a material, and the texels around them, lie on its textures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..scene.cutouts import map_uvs
from ..scene.model import Mesh
from ..scene.texture import Texture
from .geometry import PatchGeometry

#: Samples along u and v of a texel; textures are shrunk until their pixels are no finer.
SAMPLES = 4

#: Up to this number of materials their patches are searched for one by one; beyond it they are sorted.
_SEARCHED = 8

#: Images are averaged over squares of pixels while samples are at least this many of their pixels apart.
_SHRINK = 2


@dataclass(frozen=True)
class TexturedPatches:
    """The patches of one material, and the triangles that it is on.

    patch      (m,) int64, ascending
    triangles  (k,) int64, index into `Triangles`, ascending: mesh after mesh
    mesh       (k,) int32, of each triangle
    count      (k,) int64, patches on each triangle
    steps      (k, 2, 3) float64, how barycentrics change from texel to texel along u and v
    """

    patch: np.ndarray
    triangles: np.ndarray
    mesh: np.ndarray
    count: np.ndarray
    steps: np.ndarray

    def corners(self, meshes: Sequence[Mesh], texture: Texture) -> np.ndarray:
        """Return where the corners of the triangles are on a texture, (k, 3, 2) float32."""
        starts = np.r_[0, np.cumsum([len(mesh.positions) for mesh in meshes])]
        corners = np.zeros((len(self.triangles), 3, 2), np.float32)
        here, first = np.unique(self.mesh, return_index=True)
        for number, start, end in zip(here, first, [*first[1:], len(corners)], strict=True):
            uvs = meshes[number].texture_uvs[texture.uv_map]
            corners[start:end] = map_uvs(texture, uvs[self.triangles[start:end] - starts[number]])
        return corners

    def squares(self, corners: np.ndarray, texture: Texture) -> int:
        """Return the side of the squares, pixels, that an image is averaged over: a power of two.

        Its pixels are then about as far apart as the samples of a typical texel: by the median over texels.
        """
        size = np.array([texture.pixels.shape[1], texture.pixels.shape[0]])
        length = np.linalg.norm(np.einsum("nsk,nkd->nsd", self.steps, corners) * size, axis=2).ravel()
        apart = _weighted_median(length, np.repeat(self.count, 2)) / SAMPLES
        side = 1 << int(np.log2(max(apart, 1.0)))
        return side if side >= _SHRINK else 1


def textured_patches(
    geometry: PatchGeometry, resolution: int, materials: Sequence[bool]
) -> list[TexturedPatches | None]:
    """Return the patches and the triangles of each material that is chosen, None of the others."""
    triangles = geometry.triangles
    patches, places = (_grouped(of.material, materials) for of in (geometry, triangles))
    return [
        TexturedPatches(
            patch, place, triangles.mesh[place], geometry.on_triangle[place],
            _barycentric_steps(triangles.uvs[place], resolution),
        ) if patch is not None and place is not None else None
        for patch, place in zip(patches, places, strict=True)
    ]  # fmt: skip


def _grouped(numbers: np.ndarray, chosen: Sequence[bool]) -> list[np.ndarray | None]:
    """Return where each chosen number stands among numbers, (n,): (m,) int64 each, ascending.

    None of those that are not chosen.
    """
    if sum(chosen) <= _SEARCHED:
        return [np.flatnonzero(numbers == number) if wanted else None for number, wanted in enumerate(chosen)]
    order = np.argsort(numbers.astype(np.min_scalar_type(len(chosen))), kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(numbers, minlength=len(chosen)))[:-1])
    return [group if wanted else None for group, wanted in zip(groups, chosen, strict=True)]


def averaged_size(texture: Texture, side: int) -> tuple[int, int]:
    """Return the height and width of a texture averaged over squares."""
    height, width = (-(-size // side) for size in texture.pixels.shape[:2])
    return height, width


def _weighted_median(values: np.ndarray, count: np.ndarray) -> float:
    """Return the median of values, each of which is there `count` times."""
    order = np.argsort(values)
    last = np.cumsum(count[order])
    total = int(last[-1])
    middle = np.searchsorted(last, [(total - 1) // 2, total // 2], side="right")
    return float(values[order[middle]].mean())


def _barycentric_steps(uvs: np.ndarray, resolution: int) -> np.ndarray:
    """Return how barycentrics change from texel to texel along u and v, (k, 2, 3) float64."""
    first, second = np.moveaxis((uvs[:, 1:] - uvs[:, :1]).astype(np.float64) * resolution, 1, 0)
    determinant = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    inverse = np.divide(1.0, determinant, out=np.zeros_like(determinant), where=determinant != 0)
    along_u = np.stack([second[:, 1], -first[:, 1]], axis=1) * inverse[:, None]
    along_v = np.stack([-second[:, 0], first[:, 0]], axis=1) * inverse[:, None]
    steps = np.stack([along_u, along_v], axis=1)
    return np.concatenate([-steps.sum(axis=2, keepdims=True), steps], axis=2)
