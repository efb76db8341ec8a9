"""Textured patches: mapping between the texels of patches and the pixels of their textures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..scene.cutouts import map_uvs
from ..scene.model import Mesh
from ..scene.texture import Texture
from .geometry import PatchGeometry

#: Sample points along u and v of a texel.
SAMPLES = 4

#: Maximum number of materials for which one search each is faster than one sort.
_SEARCHED = 8

#: Minimum distance of sample points in pixels for which an image is reduced by a box filter.
_SHRINK = 2


@dataclass(frozen=True)
class TexturedPatches:
    """Patches and triangles of one material.

    patch:      (m,) int64, ascending
    triangles:  (k,) int64, index into `Triangles`, ascending, grouped by mesh
    mesh:       (k,) int32, mesh of each triangle
    count:      (k,) int64, number of patches on each triangle
    steps:      (k, 2, 3) float64, change of barycentrics by one texel along u and v
    """

    patch: np.ndarray
    triangles: np.ndarray
    mesh: np.ndarray
    count: np.ndarray
    steps: np.ndarray

    def corners(self, meshes: Sequence[Mesh], texture: Texture) -> np.ndarray:
        """Return the texture UVs of the triangle corners, (k, 3, 2) float32."""
        starts = np.r_[0, np.cumsum([len(mesh.positions) for mesh in meshes])]
        corners = np.zeros((len(self.triangles), 3, 2), np.float32)
        here, first = np.unique(self.mesh, return_index=True)
        for number, start, end in zip(here, first, [*first[1:], len(corners)], strict=True):
            uvs = meshes[number].texture_uvs[texture.uv_map]
            corners[start:end] = map_uvs(texture, uvs[self.triangles[start:end] - starts[number]])
        return corners

    def squares(self, corners: np.ndarray, texture: Texture) -> int:
        """Return the width in pixels of the box filter for an image, a power of two.

        The reduced pixels are then about as far apart as the sample points of the median texel.
        """
        size = np.array([texture.pixels.shape[1], texture.pixels.shape[0]])
        length = np.linalg.norm(np.einsum("nsk,nkd->nsd", self.steps, corners) * size, axis=2).ravel()
        apart = _weighted_median(length, np.repeat(self.count, 2)) / SAMPLES
        side = 1 << int(np.log2(max(apart, 1.0)))
        return side if side >= _SHRINK else 1


def textured_patches(
    geometry: PatchGeometry, resolution: int, materials: Sequence[bool]
) -> list[TexturedPatches | None]:
    """Return patches and triangles of each chosen material, None for the others."""
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
    """Return the indices of each value in `numbers`, (m,) int64 ascending; None for values not chosen.

    numbers:  (n,) integers, each an index into `chosen`
    chosen:   True for each value whose indices are needed
    """
    if sum(chosen) <= _SEARCHED:
        return [np.flatnonzero(numbers == number) if wanted else None for number, wanted in enumerate(chosen)]
    order = np.argsort(numbers.astype(np.min_scalar_type(len(chosen))), kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(numbers, minlength=len(chosen)))[:-1])
    return [group if wanted else None for group, wanted in zip(groups, chosen, strict=True)]


def averaged_size(texture: Texture, side: int) -> tuple[int, int]:
    """Return the height and width of a texture after the box filter."""
    height, width = (-(-size // side) for size in texture.pixels.shape[:2])
    return height, width


def _weighted_median(values: np.ndarray, count: np.ndarray) -> float:
    """Return the median of values that count `count` times each."""
    order = np.argsort(values)
    last = np.cumsum(count[order])
    total = int(last[-1])
    middle = np.searchsorted(last, [(total - 1) // 2, total // 2], side="right")
    return float(values[order[middle]].mean())


def _barycentric_steps(uvs: np.ndarray, resolution: int) -> np.ndarray:
    """Return the change of barycentrics by one texel along u and v, (k, 2, 3) float64."""
    first, second = np.moveaxis((uvs[:, 1:] - uvs[:, :1]).astype(np.float64) * resolution, 1, 0)
    determinant = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    inverse = np.divide(1.0, determinant, out=np.zeros_like(determinant), where=determinant != 0)
    along_u = np.stack([second[:, 1], -first[:, 1]], axis=1) * inverse[:, None]
    along_v = np.stack([-second[:, 0], first[:, 0]], axis=1) * inverse[:, None]
    steps = np.stack([along_u, along_v], axis=1)
    return np.concatenate([-steps.sum(axis=2, keepdims=True), steps], axis=2)
