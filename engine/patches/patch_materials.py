"""Reflectance and emission of patches: constants and textures, averaged over each texel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from ..array_ops import any_in_rows, indices_where, take_rows, taken
from ..device.buffers import upload
from ..device.cl_device import ComputeDevice
from ..device.device_array import DeviceArray, Values, colors_on_host, values_at
from ..device.device_rows import device_rows, take_numbers
from ..nonzero import note_rows, rows_once
from ..scene.digests import same_values
from ..scene.model import Scene
from ..scene.texture import Texture
from .device_charts import listed_entries
from .geometry import PatchGeometry
from .host_texture_means import multiply_on_host
from .texture_means import TextureMeans
from .textured import TexturedPatches, textured_patches

#: Material properties of patches, each a color times a texture.
_KINDS = ("reflectance", "emission")

#: Approximate number of patches from which the mean reflectance is computed.
_ASKED = 1 << 10

#: Function that multiplies patch values, (n, 3) float32, in place by the textures of their materials.
_Multiplier = Callable[[Any, Sequence[tuple[TexturedPatches, Texture]]], None]


@dataclass(frozen=True)
class PatchMaterials:
    """Material of each patch, averaged over its texel.

    reflectance:    (n, 3) float32, on host or device; diffuse reflectance plus transmittance of translucent
                    surfaces
    emission:       (n, 3) float32, W/(m^2 sr), radiance of the front face
    back_emission:  (n, 3) float32, W/(m^2 sr), radiance of the back face; None if equal to the front
    own:            (n, 3) float32, reflected fraction of `reflectance`; None if all of it is reflected
    emitters:       (k,) int64, patches that emit from either face; None to compute them
    """

    reflectance: Values
    emission: np.ndarray
    back_emission: np.ndarray | None = None
    own: np.ndarray | None = None
    emitters: np.ndarray | None = None

    @property
    def emission_of_backs(self) -> np.ndarray:
        """Radiance of the back face of each patch, (n, 3) float32."""
        return self.emission if self.back_emission is None else self.back_emission

    @cached_property
    def shining(self) -> np.ndarray:
        """Indices of patches that emit from either face, (k,) int64."""
        if self.emitters is not None:
            return self.emitters
        if self.back_emission is None:
            return rows_once(self.emission)
        return np.flatnonzero(any_in_rows(self.emission) | any_in_rows(self.back_emission))

    @cached_property
    def shining_backs(self) -> np.ndarray:
        """Indices of patches that emit from the back face, (k,) int64."""
        if self.back_emission is None:
            return self.shining
        return np.flatnonzero(any_in_rows(self.back_emission))

    @cached_property
    def mean_reflectance(self) -> float:
        """Mean reflectance of evenly spaced patches, over all channels; 0 without patches."""
        count = len(self.reflectance)
        some = np.arange(0, count, max(1, count // _ASKED))
        return float(values_at(self.reflectance, some).mean()) if count else 0.0

    def has_emitters_of(self, others: PatchMaterials) -> bool:
        """Return True if both have the same sets of emissive patches and of patches with an emissive back."""
        if self.emission is others.emission and self.back_emission is others.back_emission:
            return True
        pairs = (self.shining, others.shining), (self.shining_backs, others.shining_backs)
        return all(np.array_equal(mine, theirs) for mine, theirs in pairs)

    def black_at(self, patches: np.ndarray) -> PatchMaterials:
        """Return a copy with zero reflectance at masked patches, (n,) bool."""
        places = np.flatnonzero(patches)
        if not len(places):
            return self
        if isinstance(self.reflectance, DeviceArray):
            return replace(self, reflectance=self.reflectance.black_at(places))
        reflectance = self.reflectance.copy()
        reflectance[places] = 0
        return replace(self, reflectance=reflectance)


@dataclass(frozen=True)
class KnownSurfaces:
    """Materials of the patches in a previous scene, which are reused where unchanged."""

    scene: Scene
    surfaces: PatchMaterials

    def shown_by(self, scene: Scene, kind: str) -> np.ndarray:
        """Return a mask of materials, (m,) bool, with the same color and texture as in the known scene.

        scene:  scene of the same geometry
        kind:   "reflectance" or "emission"
        """
        pairs = zip(self.scene.meshes, scene.meshes, strict=True)
        if not all(same_values(mesh.texture_uvs, other.texture_uvs) for mesh, other in pairs):
            return np.zeros(len(scene.materials), bool)
        materials = zip(self.scene.materials, scene.materials, strict=True)
        return np.array([
            all(same_values(getattr(here, name), getattr(there, name)) for name in (kind, f"{kind}_map"))
            for here, there in materials
        ])  # fmt: skip


def patch_surfaces(
    compute: ComputeDevice | None,
    scene: Scene,
    geometry: PatchGeometry,
    resolution: int,
    known: KnownSurfaces | None = None,
) -> PatchMaterials:
    """Return reflectance and emission of each patch.

    compute:     OpenCL device; None to use the host
    scene:       scene with materials and textures
    geometry:    geometry of the patches
    resolution:  width of the lightmaps, texels
    known:       materials of the same patches in a scene of the same geometry; None to read all textures
    """
    if any(material.translucent for material in scene.materials):
        return _translucent_surfaces(compute, scene, geometry, resolution)
    if known is None:
        return _made_surfaces(compute, scene, geometry, resolution)
    values: dict[str, Values] = {}
    textures: dict[str, list[Texture | None]] = {}
    for kind in _KINDS:
        maps = _maps(scene, kind)
        same, before = known.shown_by(scene, kind), getattr(known.surfaces, kind)
        if same.all():
            values[kind] = before
            continue

        # Unchanged textures are not read again.
        made = values[kind] = _constants(scene, kind, geometry)
        textures[kind] = [None if stays else texture for stays, texture in zip(same, maps, strict=True)]
        stays = same & [texture is not None for texture in maps]
        if stays.any():
            rows = np.flatnonzero(stays[geometry.material])
            made[rows] = values_at(before, rows)
    device = compute if compute is not None and _fits(compute, list(textures.values())) else None
    _multiply(device, scene, geometry, resolution, [(values[kind], textures[kind]) for kind in textures])
    backs = _back_emission(compute, scene, geometry, resolution)
    return PatchMaterials(values["reflectance"], colors_on_host(values["emission"]), backs)


def _made_surfaces(
    compute: ComputeDevice | None, scene: Scene, geometry: PatchGeometry, resolution: int
) -> PatchMaterials:
    """Compute the materials of all patches; with OpenCL the reflectance stays on the device."""
    maps = [_maps(scene, kind) for kind in _KINDS]
    device = compute if compute is not None and _fits(compute, maps) else None
    reflectance: Values = (
        _constants_on(device, scene, geometry) if device else _constants(scene, "reflectance", geometry)
    )

    # Few materials emit, so only their patches are written and tested.
    emitting, material = _emitting(device, scene, geometry)
    emission = np.zeros((len(geometry.triangle_rows), 3), np.float32)
    colors = np.array([material.emission for material in scene.materials], np.float32)
    emission[emitting] = colors[material]
    _multiply(device, scene, geometry, resolution, list(zip((reflectance, emission), maps, strict=True)))
    back_emission = _back_emission(compute, scene, geometry, resolution)
    note_rows(emission, emitting)
    emitters = emitting[any_in_rows(take_rows(emission, emitting))] if back_emission is None else None
    return PatchMaterials(reflectance, emission, back_emission, emitters=emitters)


def _back_emission(
    compute: ComputeDevice | None, scene: Scene, geometry: PatchGeometry, resolution: int
) -> np.ndarray | None:
    """Return the radiance of the back face of each patch, (n, 3) float32; None if equal to the front."""
    if all(material.back is None for material in scene.materials):
        return None
    backs = [
        material
        if material.back is None
        else replace(material, emission=material.back.emission, emission_map=material.back.emission_map)
        for material in scene.materials
    ]
    turned = replace(scene, materials=tuple(backs))
    emission, maps = _constants(turned, "emission", geometry), _maps(turned, "emission")
    device = compute if compute is not None and _fits(compute, [maps]) else None
    _multiply(device, turned, geometry, resolution, [(emission, maps)])
    return emission


def _translucent_surfaces(
    compute: ComputeDevice | None, scene: Scene, geometry: PatchGeometry, resolution: int
) -> PatchMaterials:
    """Return the materials of patches in a scene with translucent materials."""
    surfaces = _made_surfaces(compute, scene, geometry, resolution)
    transmitted = _constants(scene, "translucency", geometry)
    maps = _maps(scene, "translucency")
    device = compute if compute is not None and _fits(compute, [maps]) else None
    _multiply(device, scene, geometry, resolution, [(transmitted, maps)])
    reflected = colors_on_host(surfaces.reflectance)
    total = reflected + transmitted
    own = np.divide(reflected, total, out=np.ones_like(total), where=transmitted > 0)
    return replace(surfaces, reflectance=total, own=own, emitters=surfaces.shining)


def _maps(scene: Scene, kind: str) -> list[Texture | None]:
    """Return the texture of each material for `kind`, or None."""
    return [getattr(material, f"{kind}_map") for material in scene.materials]


def _emitting(
    compute: ComputeDevice | None, scene: Scene, geometry: PatchGeometry
) -> tuple[np.ndarray, np.ndarray]:
    """Return the patches of emissive materials, (k,) int64, and their materials, (k,) integers.

    Textures may be black there.
    """
    emits = np.array([material.emission.any() for material in scene.materials], bool)
    if not emits.any():
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    material = geometry.triangles.material
    if compute and len(geometry.triangle_rows):
        count, triangles = len(geometry.triangle_rows), device_rows(compute, geometry.triangle_rows)
        number = np.where(emits, np.arange(1, len(emits) + 1), 0).astype(np.uint32)
        of_patch = take_numbers(compute, upload(compute, number[material]), triangles, count)
        patches, materials = listed_entries(compute, of_patch, 1, count)
        return patches.on_host.astype(np.int64), materials.on_host
    of_triangle, triangle = emits.take(material), geometry.triangle
    patch = indices_where(len(triangle), 5, lambda slab: of_triangle.take(triangle[slab]))
    return patch, material[triangle[patch]]


def _multiply(
    compute: ComputeDevice | None,
    scene: Scene,
    geometry: PatchGeometry,
    resolution: int,
    kinds: Sequence[tuple[Values, Sequence[Texture | None]]],
) -> None:
    """Multiply values of patches, (n, 3) float32, in place by the textures of their materials.

    compute:                      device of the textures and of values that are on a device; None to use the
                                  host
    scene, geometry, resolution:  scene, its patches, and width of the lightmaps in texels
    kinds:                        values and the texture of each material
    """
    if any(texture for _, textures in kinds for texture in textures):
        chosen = [any(maps) for maps in zip(*(textures for _, textures in kinds), strict=True)]
        textured = textured_patches(geometry, resolution, chosen)
        multiply: _Multiplier = (
            TextureMeans(compute, geometry, scene.meshes).multiply
            if compute
            else partial(multiply_on_host, geometry, scene.meshes)
        )
        for values, textures in kinds:
            multiply(values, _on_patches(textures, textured))


def _fits(compute: ComputeDevice, maps: Sequence[Sequence[Texture | None]]) -> bool:
    """Return True if each texture fits into one buffer of the OpenCL device."""
    sizes = [texture.pixels.nbytes for textures in maps for texture in textures if texture]
    return max(sizes, default=0) <= int(compute.device.max_mem_alloc_size)


def _constants(scene: Scene, kind: str, geometry: PatchGeometry) -> np.ndarray:
    """Return the color of each patch's material for `kind`, without textures, (n, 3) float32."""
    colors = [getattr(material, kind) for material in scene.materials]
    if not np.any(colors):
        return np.zeros((len(geometry.triangle_rows), 3), np.float32)
    return taken(_of_triangles(colors, geometry), geometry.triangle)


def _constants_on(compute: ComputeDevice, scene: Scene, geometry: PatchGeometry) -> DeviceArray:
    """Return the reflectance of each patch's material, without textures, on the OpenCL device."""
    colors = _of_triangles([material.reflectance for material in scene.materials], geometry)
    of_triangle = DeviceArray(compute, upload(compute, colors), len(colors))
    return of_triangle.taken(device_rows(compute, geometry.triangle_rows), len(geometry.triangle_rows))


def _of_triangles(colors: Sequence[np.ndarray], geometry: PatchGeometry) -> np.ndarray:
    """Return the color of each triangle's material, (t, 3) float32."""
    table: np.ndarray = np.stack(colors).astype(np.float32).take(geometry.triangles.material, axis=0)
    return table


def _on_patches(
    textures: Sequence[Texture | None], textured: Sequence[TexturedPatches | None]
) -> list[tuple[TexturedPatches, Texture]]:
    """Return the patches of each textured material with its texture."""
    maps = zip(textured, textures, strict=True)
    return [(patches, texture) for patches, texture in maps if texture and patches and len(patches.patch)]
