"""What each patch reflects and emits: constants and textures, averaged over the patch's texel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from ..device.compute import Compute
from ..scene.digests import same_values
from ..scene.model import Scene, Texture
from .geometry import PatchGeometry
from .host_texture_means import multiply_on_host
from .texture_means import TextureMeans
from .textured import TexturedPatches, textured_patches

#: Fields of a material that decide what patches reflect and emit.
_LOOKS = ("reflectance", "emission", "reflectance_map", "emission_map")

#: Multiplies values of patches, (n, 3) float32, by textures of their materials.
_Multiplier = Callable[[np.ndarray, Sequence[tuple[TexturedPatches, Texture]]], None]


@dataclass(frozen=True)
class PatchSurfaces:
    """Surfaces as the solver needs them.

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

    def black_at(self, patches: np.ndarray) -> PatchSurfaces:
        """Return the same, but that some patches, (n,) bool, reflect nothing."""
        if not patches.any():
            return self
        reflectance = self.reflectance.copy()
        reflectance[patches] = 0
        return PatchSurfaces(reflectance, self.emission)


@dataclass(frozen=True)
class KnownSurfaces:
    """What patches reflected and emitted in a scene before: textures need not be read again."""

    scene: Scene
    surfaces: PatchSurfaces

    def shown_by(self, scene: Scene) -> np.ndarray:
        """Return which materials of a scene of the same geometry make the same of patches, (m,) bool."""
        pairs = zip(self.scene.meshes, scene.meshes, strict=True)
        if not all(same_values(mesh.texture_uvs, other.texture_uvs) for mesh, other in pairs):
            return np.zeros(len(scene.materials), bool)
        materials = zip(self.scene.materials, scene.materials, strict=True)
        return np.array([
            all(same_values(getattr(here, name), getattr(there, name)) for name in _LOOKS)
            for here, there in materials
        ])  # fmt: skip


def patch_surfaces(
    compute: Compute | None,
    scene: Scene,
    geometry: PatchGeometry,
    resolution: int,
    known: KnownSurfaces | None = None,
) -> PatchSurfaces:
    """Return what every patch of lightmaps of a resolution reflects and emits.

    known: of the same patches in a scene of the same geometry; None to read all textures
    """
    if known is None:
        return _read_surfaces(compute, scene, geometry, resolution)
    same = known.shown_by(scene)
    others = [
        replace(paint, reflectance_map=None, emission_map=None) if stays else paint
        for paint, stays in zip(scene.materials, same, strict=True)
    ]
    made = _read_surfaces(compute, replace(scene, materials=tuple(others)), geometry, resolution)
    stays = same[geometry.material]
    made.reflectance[stays] = known.surfaces.reflectance[stays]
    made.emission[stays] = known.surfaces.emission[stays]
    return made


def _read_surfaces(
    compute: Compute | None, scene: Scene, geometry: PatchGeometry, resolution: int
) -> PatchSurfaces:
    """Return what every patch reflects and emits by constants and textures."""
    materials = scene.materials
    reflectance = _constants([material.reflectance for material in materials], geometry)
    emission = _constants([material.emission for material in materials], geometry)
    reflectance_maps = [material.reflectance_map for material in materials]
    emission_maps = [material.emission_map for material in materials]
    sizes = [texture.pixels.nbytes for texture in (*reflectance_maps, *emission_maps) if texture]
    if sizes:
        chosen = [any(maps) for maps in zip(reflectance_maps, emission_maps, strict=True)]
        textured = textured_patches(geometry, resolution, chosen)
        multiply = _multiplier(compute, scene, geometry, max(sizes))
        multiply(reflectance, _on_patches(reflectance_maps, textured))
        multiply(emission, _on_patches(emission_maps, textured))
    return PatchSurfaces(reflectance, emission)


def _constants(colors: list[np.ndarray], geometry: PatchGeometry) -> np.ndarray:
    """Return the colour of each patch's material, (n, 3) float32."""
    if not np.any(colors):
        return np.zeros((len(geometry.triangle), 3), np.float32)
    of_triangle = np.stack(colors).astype(np.float32).take(geometry.triangles.material, axis=0)
    return of_triangle.take(geometry.triangle, axis=0)


def _on_patches(
    textures: Sequence[Texture | None], textured: Sequence[TexturedPatches | None]
) -> list[tuple[TexturedPatches, Texture]]:
    """Return the textures, one a material, that patches show, with these patches."""
    maps = zip(textured, textures, strict=True)
    return [(patches, texture) for patches, texture in maps if texture and patches and len(patches.patch)]


def _multiplier(compute: Compute | None, scene: Scene, geometry: PatchGeometry, largest: int) -> _Multiplier:
    """Return what multiplies by textures: the device if it holds the largest one, bytes, or the host."""
    if compute is not None and largest <= compute.device.max_mem_alloc_size:
        return TextureMeans(compute, geometry, scene.meshes).multiply
    return partial(multiply_on_host, geometry, scene.meshes)
