"""What each patch reflects and emits: constants and textures, averaged over the patch's texel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ..device.compute import Compute
from ..scene.digests import same_values
from ..scene.model import Scene, Texture
from ..short_rows import any_in_rows, nonzero_rows, some_rows
from ..slabs import taken
from .geometry import PatchGeometry
from .host_texture_means import multiply_on_host
from .texture_means import TextureMeans
from .textured import TexturedPatches, textured_patches

#: What materials give to patches, each a colour times a texture.
_KINDS = ("reflectance", "emission")

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
        return nonzero_rows(self.emission)

    def shine_as(self, others: PatchSurfaces) -> bool:
        """Return whether the same patches emit."""
        return self.emission is others.emission or np.array_equal(self.shining, others.shining)

    def black_at(self, patches: np.ndarray) -> PatchSurfaces:
        """Return the same, but that some patches, (n,) bool, reflect nothing."""
        if not patches.any():
            return self
        reflectance = self.reflectance.copy()
        reflectance[patches] = 0
        return PatchSurfaces(reflectance, self.emission)


@dataclass(frozen=True)
class KnownSurfaces:
    """What patches reflected and emitted in a scene before: most of them still do."""

    scene: Scene
    surfaces: PatchSurfaces

    def shown_by(self, scene: Scene, kind: str) -> np.ndarray:
        """Return which materials of a scene of the same geometry have the same of a kind, (m,) bool."""
        pairs = zip(self.scene.meshes, scene.meshes, strict=True)
        if not all(same_values(mesh.texture_uvs, other.texture_uvs) for mesh, other in pairs):
            return np.zeros(len(scene.materials), bool)
        materials = zip(self.scene.materials, scene.materials, strict=True)
        return np.array([
            all(same_values(getattr(here, name), getattr(there, name)) for name in (kind, f"{kind}_map"))
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
    values, textures = {}, {}
    for kind in _KINDS:
        maps = [getattr(material, f"{kind}_map") for material in scene.materials]
        if known is None:
            values[kind], textures[kind] = _constants(scene, kind, geometry), maps
            continue
        same, before = known.shown_by(scene, kind), getattr(known.surfaces, kind)
        if same.all():
            values[kind] = before
            continue

        # Textures that stay are not read again.
        values[kind] = _constants(scene, kind, geometry)
        textures[kind] = [None if stays else texture for stays, texture in zip(same, maps, strict=True)]
        stays = same & [texture is not None for texture in maps]
        if stays.any():
            rows = np.flatnonzero(stays[geometry.material])
            values[kind][rows] = before[rows]
    _multiply(compute, scene, geometry, resolution, [(values[kind], textures[kind]) for kind in textures])
    surfaces = PatchSurfaces(**values)
    if known is None:
        # Few materials emit: all other patches need not be asked.
        vars(surfaces)["shining"] = _shining(scene, geometry, surfaces.emission)
    return surfaces


def _shining(scene: Scene, geometry: PatchGeometry, emission: np.ndarray) -> np.ndarray:
    """Return `PatchSurfaces.shining`: patches of materials that emit whose textures leave some of it."""
    emits = np.array([material.emission.any() for material in scene.materials], bool)
    if not emits.any():
        return np.zeros(0, np.int64)
    patches = np.flatnonzero(taken(emits.take(geometry.triangles.material), geometry.triangle))
    return patches[any_in_rows(some_rows(emission, patches))]


def _multiply(
    compute: Compute | None,
    scene: Scene,
    geometry: PatchGeometry,
    resolution: int,
    kinds: Sequence[tuple[np.ndarray, Sequence[Texture | None]]],
) -> None:
    """Multiply values of patches, (n, 3) float32, by textures of each material, where it has one."""
    sizes = [texture.pixels.nbytes for _, textures in kinds for texture in textures if texture]
    if sizes:
        chosen = [any(maps) for maps in zip(*(textures for _, textures in kinds), strict=True)]
        textured = textured_patches(geometry, resolution, chosen)
        multiply = _multiplier(compute, scene, geometry, max(sizes))
        for values, textures in kinds:
            multiply(values, _on_patches(textures, textured))


def _constants(scene: Scene, kind: str, geometry: PatchGeometry) -> np.ndarray:
    """Return the colour of a kind of each patch's material, (n, 3) float32."""
    colors = [getattr(material, kind) for material in scene.materials]
    if not np.any(colors):
        return np.zeros((len(geometry.triangle), 3), np.float32)
    of_triangle = np.stack(colors).astype(np.float32).take(geometry.triangles.material, axis=0)
    return taken(of_triangle, geometry.triangle)


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
