"""What each patch reflects and emits: constants and textures, averaged over the patch's texel."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..scene.color import srgb_to_linear
from ..scene.cutouts import map_uvs
from ..scene.model import Material, Scene, Texture
from ..scene.resampling import shrink
from ..scene.textures import sample
from ..scene.triangles import Triangles
from .geometry import PatchGeometry
from .patch_list import PatchList

#: Samples along u and v of a texel; textures are shrunk until their pixels are no finer.
_SAMPLES = 4

#: Images are halved while a sample's footprint is so many pixels wide.
_SHRINK = 2


@dataclass(frozen=True)
class PatchSurfaces:
    """Surfaces as the solver wants them.

    reflectance  (n, 3) float32
    emission     (n, 3) float32, radiance
    """

    reflectance: np.ndarray
    emission: np.ndarray


def patch_surfaces(
    scene: Scene, triangles: Triangles, patches: PatchList, geometry: PatchGeometry
) -> PatchSurfaces:
    """Return what every patch reflects and emits."""
    reflectance = _constants([material.reflectance for material in scene.materials], geometry)
    emission = _constants([material.emission for material in scene.materials], geometry)
    for index, material in enumerate(scene.materials):
        if material.reflectance_map is None and material.emission_map is None:
            continue
        chosen = np.flatnonzero(geometry.material == index)
        samples = _TexelSamples(scene, triangles, patches, geometry, chosen)
        for values, texture in _maps(material, reflectance, emission):
            values[chosen] *= samples.mean(texture)
    return PatchSurfaces(reflectance, emission)


def _constants(colors: list[np.ndarray], geometry: PatchGeometry) -> np.ndarray:
    """Return the colour of each patch's material, (n, 3) float32."""
    return np.stack(colors).astype(np.float32).take(geometry.material, axis=0)


def _maps(
    material: Material, reflectance: np.ndarray, emission: np.ndarray
) -> Iterator[tuple[np.ndarray, Texture]]:
    """Yield each texture of a material with the patches' values that it multiplies."""
    if material.reflectance_map is not None:
        yield reflectance, material.reflectance_map
    if material.emission_map is not None:
        yield emission, material.emission_map


class _TexelSamples:
    """Points of some patches' texels, those that lie in the patch's triangle."""

    def __init__(
        self,
        scene: Scene,
        triangles: Triangles,
        patches: PatchList,
        geometry: PatchGeometry,
        chosen: np.ndarray,
    ) -> None:
        self._scene = scene
        self._triangle = geometry.triangle[chosen]
        self._mesh = triangles.mesh[self._triangle]
        starts = np.r_[0, np.cumsum([len(mesh.positions) for mesh in scene.meshes])]
        self._local = self._triangle - starts[self._mesh]
        self._weights = patches.barycentric[chosen].astype(np.float64)
        self._steps = _barycentric_steps(triangles.uvs[self._triangle], patches.resolution)

    def mean(self, texture: Texture) -> np.ndarray:
        """Return a texture's mean over each texel, (m, c) float32."""
        corners = self._corner_uvs(texture)
        footprint = self._footprint(corners, texture.pixels.shape)
        if texture.srgb and footprint >= _SHRINK:
            texture = replace(texture, pixels=srgb_to_linear(texture.pixels), srgb=False)
        pixels = _shrunk(texture.pixels, footprint)
        total = np.zeros((len(corners), texture.pixels.shape[2]))
        count = np.zeros((len(corners), 1))
        for weights, inside in self._points():
            uv = np.einsum("nk,nkd->nd", weights[inside], corners[inside])
            total[inside] += sample(pixels, uv, texture)
            count[inside] += 1
        centre = sample(pixels, np.einsum("nk,nkd->nd", self._weights, corners), texture)
        mean: np.ndarray = np.where(count > 0, total / np.maximum(count, 1), centre).astype(np.float32)
        return mean

    def _corner_uvs(self, texture: Texture) -> np.ndarray:
        """Return where the corners of the patches' triangles are on a texture, (m, 3, 2) float32."""
        corners = np.zeros((len(self._triangle), 3, 2), np.float32)
        for index in np.unique(self._mesh):
            mine = self._mesh == index
            uvs = self._scene.meshes[index].texture_uvs[texture.uv_map]
            corners[mine] = map_uvs(texture, uvs[self._local[mine]])
        return corners

    def _points(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield the barycentrics of one point of every texel, (m, 3), and whether it is in the triangle."""
        offsets = (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5
        for v in offsets:
            for u in offsets:
                weights = self._weights + u * self._steps[:, 0] + v * self._steps[:, 1]
                yield weights, (weights >= 0).all(axis=1)

    def _footprint(self, corners: np.ndarray, shape: tuple[int, ...]) -> float:
        """Return how many pixels apart the points of a typical texel are."""
        size = np.array([shape[1], shape[0]])
        steps = np.einsum("nsk,nkd->nsd", self._steps, corners) * size
        return float(np.median(np.linalg.norm(steps, axis=2))) / _SAMPLES if len(steps) else 1.0


def _barycentric_steps(uvs: np.ndarray, resolution: int) -> np.ndarray:
    """Return how barycentrics change from texel to texel along u and v, (m, 2, 3) float64."""
    first, second = np.moveaxis((uvs[:, 1:] - uvs[:, :1]).astype(np.float64) * resolution, 1, 0)
    determinant = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    inverse = np.divide(1.0, determinant, out=np.zeros_like(determinant), where=determinant != 0)
    along_u = np.stack([second[:, 1], -first[:, 1]], axis=1) * inverse[:, None]
    along_v = np.stack([-second[:, 0], first[:, 0]], axis=1) * inverse[:, None]
    steps = np.stack([along_u, along_v], axis=1)
    return np.concatenate([-steps.sum(axis=2, keepdims=True), steps], axis=2)


def _shrunk(pixels: np.ndarray, footprint: float) -> np.ndarray:
    """Return an image averaged over squares, as wide as the power of two that is up to `footprint` pixels."""
    side = 1 << int(np.log2(max(footprint, 1.0)))
    height, width = (-(-size // side) for size in pixels.shape[:2])
    return pixels if side < _SHRINK else shrink(pixels, height, width)
