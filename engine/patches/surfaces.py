"""What each patch reflects and emits: constants and textures, averaged over the patch's texel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ..device.compute import Compute
from ..scene.model import Scene, Texture
from .geometry import PatchGeometry
from .host_texture_means import multiply_on_host
from .texture_means import TextureMeans
from .textured import TexturedPatches, textured_patches

#: Multiplies values of patches, (n, 3) float32, by textures of their materials.
_Multiplier = Callable[[np.ndarray, Sequence[tuple[TexturedPatches, Texture]]], None]


@dataclass(frozen=True)
class PatchSurfaces:
    """Surfaces as the solver wants them.

    reflectance  (n, 3) float32
    emission     (n, 3) float32, radiance
    """

    reflectance: np.ndarray
    emission: np.ndarray

    @cached_property
    def shining(self) -> np.ndarray:
        """Patches that emit, (k,) int64."""
        red, green, blue = (self.emission != 0).T
        return np.flatnonzero(red | green | blue)


def patch_surfaces(
    compute: Compute | None, scene: Scene, geometry: PatchGeometry, resolution: int
) -> PatchSurfaces:
    """Return what every patch of lightmaps of a resolution reflects and emits."""
    materials = scene.materials
    reflectance = _constants([material.reflectance for material in materials], geometry)
    emission = _constants([material.emission for material in materials], geometry)
    maps = (
        (reflectance, [material.reflectance_map for material in materials]),
        (emission, [material.emission_map for material in materials]),
    )
    sizes = [texture.pixels.nbytes for _, textures in maps for texture in textures if texture]
    if sizes:
        multiply = _multiplier(compute, scene, geometry, max(sizes))
        for values, textures in maps:
            multiply(values, _on_patches(textures, geometry, resolution))
    return PatchSurfaces(reflectance, emission)


def _constants(colors: list[np.ndarray], geometry: PatchGeometry) -> np.ndarray:
    """Return the colour of each patch's material, (n, 3) float32."""
    return np.stack(colors).astype(np.float32).take(geometry.material, axis=0)


def _on_patches(
    textures: Sequence[Texture | None], geometry: PatchGeometry, resolution: int
) -> list[tuple[TexturedPatches, Texture]]:
    """Return the textures, one a material, that patches show, with these patches."""
    maps = [
        (textured_patches(geometry, resolution, material), texture)
        for material, texture in enumerate(textures)
        if texture is not None
    ]
    return [(textured, texture) for textured, texture in maps if len(textured.patch)]


def _multiplier(compute: Compute | None, scene: Scene, geometry: PatchGeometry, largest: int) -> _Multiplier:
    """Return what multiplies by textures: the device if it holds images of so many bytes, or the host."""
    if compute is not None and largest <= compute.device.max_mem_alloc_size:
        return TextureMeans(compute, geometry, scene.meshes).multiply
    return partial(multiply_on_host, geometry, scene.meshes)
