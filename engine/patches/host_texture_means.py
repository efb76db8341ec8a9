"""NumPy version of `TextureMeans`, for machines without OpenCL."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..scene.color import srgb_to_linear
from ..scene.model import Mesh
from ..scene.resampling import shrink
from ..scene.texture import Texture, sample
from .geometry import PatchGeometry
from .textured import SAMPLES, TexturedPatches, averaged_size


def multiply_on_host(
    geometry: PatchGeometry,
    meshes: Sequence[Mesh],
    values: np.ndarray,
    maps: Sequence[tuple[TexturedPatches, Texture]],
) -> None:
    """Multiply patch values, (n, 3) float32, in place by the mean of their texture over the texel."""
    for textured, texture in maps:
        values[textured.patch] *= _mean(geometry.subset(textured.patch), meshes, textured, texture)


def _mean(
    geometry: PatchGeometry, meshes: Sequence[Mesh], textured: TexturedPatches, texture: Texture
) -> np.ndarray:
    """Return the mean of a texture over each texel, (m, 3) float32."""
    corners = textured.corners(meshes, texture)
    side = textured.squares(corners, texture)
    if texture.srgb and side > 1:
        texture = replace(texture, pixels=srgb_to_linear(texture.pixels), srgb=False)
    pixels = shrink(texture.pixels, *averaged_size(texture, side)) if side > 1 else texture.pixels

    # Average the sample points of the texel that lie inside the triangle. If none does, use the patch's own
    # point.
    local = np.searchsorted(textured.triangles, geometry.triangle)
    corners, weights = corners[local], geometry.barycentric.astype(np.float64)
    total, count = np.zeros((len(local), 3)), np.zeros((len(local), 1))
    for point in _points(weights, textured.steps[local]):
        inside = (point >= 0).all(axis=1)
        total[inside] += sample(pixels, _on_texture(point[inside], corners[inside]), texture)
        count[inside] += 1
    centre = sample(pixels, _on_texture(weights, corners), texture)
    mean: np.ndarray = np.where(count > 0, total / np.maximum(count, 1), centre).astype(np.float32)
    return mean


def _points(weights: np.ndarray, steps: np.ndarray) -> Iterator[np.ndarray]:
    """Yield one sample point of each texel as barycentrics, (m, 3) float64; it may lie off the triangle."""
    offsets = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
    for v in offsets:
        for u in offsets:
            yield weights + u * steps[:, 0] + v * steps[:, 1]


def _on_texture(weights: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return texture UVs, (m, 2) float64, at barycentrics."""
    uvs: np.ndarray = np.einsum("nk,nkd->nd", weights, corners)
    return uvs
