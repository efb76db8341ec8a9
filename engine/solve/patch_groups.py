"""Patch groups: bounces are computed for squares of patches, then every patch gathers once.

Light after several bounces is smooth, and only the sources of a final gather are averaged, so lightmaps keep
their detail. Patches that emit much more than their neighbours form groups of their own. An example is a
ceiling behind a panel: it is bright but hidden, and would replace the visible ceiling next to the panel.
Patches inside geometry stay separate too: they are dark, and would darken the floor around a sunken box.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from ..array_ops import has_nonzero, taken
from ..device.buffers import download, upload, upload_once
from ..device.cl_device import ComputeDevice
from ..device.device_array import colors_on_host
from ..device.opencl import cl
from ..device.planned_program import Source
from ..patches.patch_materials import PatchMaterials
from ..patches.patch_scene import PatchScene
from ..visibility.rays.ray_scene import RayScene
from ..visibility.rays.receiver_records import RECEIVER

#: Squares per work group along u and v, where the device allows that size.
_SQUARES = 8

#: Records and kernel files of groups and of interpolation between them, built as one program: faster than
#: three builds.
SOURCE: Source = (RECEIVER, "group_means.cl", "interpolate.cl", "patch_groups.cl")


class PatchGroups:
    """Patch groups, each solved as one patch, its representative.

    width           side of the squares, texels
    group           (n,) int64, group of each patch
    representative  (m,) int64, representative patch of each group
    texel_to_group  (atlases, r, r) uint32, group + 1 of each texel's patch, or 0
    """

    def __init__(
        self,
        rays: RayScene,
        patch_scene: PatchScene,
        area: np.ndarray,
        representative: np.ndarray,
        width: int,
    ) -> None:
        """Form groups.

        rays            rays from the patches
        patch_scene     the patches
        area            (n,) float32, m^2
        representative  (n,) uint32, see `group_representatives`
        """
        self.width = width
        self.group, self.representative = numbered(representative)
        self._rays, self._patch_scene, self._area = rays, patch_scene, area
        self._means = _GroupMeans(rays.compute, patch_scene, representative, self.representative, width)
        entries = np.zeros(len(self.group) + 1, np.uint32)
        np.add(self.group, 1, out=entries[1:], casting="unsafe")
        self.texel_to_group = taken(entries, patch_scene.texel_to_patch.ravel()).reshape(
            patch_scene.texel_to_patch.shape
        )

    @cached_property
    def patch_scene(self) -> PatchScene:
        """The groups as a PatchScene, with mean materials and the geometry of the representatives."""
        patch_scene, representative = self._patch_scene, self.representative
        surfaces = PatchMaterials(
            self.mean(colors_on_host(patch_scene.surfaces.reflectance)),
            self.mean(patch_scene.surfaces.emission),
            None
            if patch_scene.surfaces.back_emission is None
            else self.mean(patch_scene.surfaces.back_emission),
        )
        return replace(
            patch_scene,
            patches=patch_scene.patches.subset(representative),
            geometry=patch_scene.geometry.subset(representative),
            surfaces=surfaces,
            texel_to_patch=self.texel_to_group,
            source_count=None,
        )

    @cached_property
    def area(self) -> np.ndarray:
        """Total area of the patches in each group, (m,) float32, m^2."""
        members = np.bincount(self.group, minlength=len(self.representative)).astype(np.float32)
        area: np.ndarray = self.mean(self._area) * members
        return area

    @cached_property
    def rays(self) -> RayScene:
        """Rays from the groups."""
        return self._rays.shared_by(self.patch_scene)

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Return the mean of patch values over each group, (n, ...) -> (m, ...) float32."""
        if not has_nonzero(values):
            return np.zeros((len(self.representative), *values.shape[1:]), np.float32)
        return self._means.of(values)


class SinglePatches:
    """Identity grouping, in which each patch is a group of its own.

    group  (n,) int64, index of each patch
    """

    def __init__(self, count: int) -> None:
        self.group = np.arange(count)

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Return the values of the patches, (n, ...), unchanged."""
        return values


class _GroupMeans:
    """Means over groups, computed on the OpenCL device.

    representative  (n,) uint32, representative of each patch
    leading  (m,) int64, all representatives
    """

    def __init__(
        self,
        compute: ComputeDevice,
        patch_scene: PatchScene,
        representative: np.ndarray,
        leading: np.ndarray,
        width: int,
    ) -> None:
        self._compute, self._count, patches = compute, len(leading), patch_scene.patches
        (self._kernel,) = compute.kernels(SOURCE, "group_means")
        some = representative, leading.astype(np.uint32), patches.atlas[leading]
        self._groups = (
            upload_once(compute, patch_scene.texel_to_patch), np.int32(patches.resolution), np.int32(width),
            upload_once(compute, patches.texel), *(upload(compute, array) for array in some),
        )  # fmt: skip

    def of(self, values: np.ndarray) -> np.ndarray:
        """Return the group means of values, (n, ...) -> (m, ...) float32."""
        compute, channels = self._compute, values.size // len(values)
        count = self._count * channels
        means = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, 4 * count)
        given = upload(compute, values.astype(np.float32, copy=False)), np.int32(channels)
        compute.run(self._kernel, count, *self._groups, *given, means, np.uint32(count))
        return download(compute, means, (self._count, *values.shape[1:]))


def numbered(representative: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the group of each patch, (n,) int64, and the representative of each group, (m,) int64.

    representative:  (n,) uint32, representative of each patch
    """
    leading = np.flatnonzero(representative == np.arange(len(representative), dtype=np.uint32))
    number = np.zeros(len(representative), np.int64)
    number[leading] = np.arange(len(leading))
    return taken(number, representative), leading


def group_representatives(
    rays: RayScene,
    patch_scene: PatchScene,
    radiance: np.ndarray,
    inside: np.ndarray,
    width: int,
    mapped: int | None = None,
) -> np.ndarray:
    """Choose the groups; return the representative of each patch, (n,) uint32.

    Patches of back faces and of objects without lightmap are not grouped, since they are already as coarse as
    groups, and adjacent texels of their atlases may belong to distant strands of hair or leaves.

    radiance  (n,) float32, radiance before any bounce, sum of the channels
    inside    (n,) bool, patches inside geometry, see `patches_inside`
    width     side of the squares, texels
    mapped    number of patches in lightmaps, which come first; None for all on front faces
    """
    compute, patches = rays.compute, patch_scene.patches
    (group_patches,) = compute.kernels(SOURCE, "group_patches")
    lookup, texels = upload_once(compute, patch_scene.texel_to_patch), upload_once(compute, patches.texel)
    arrays = (patch_scene.geometry.material, radiance, inside.view(np.uint8))
    materials, light, apart = (upload(compute, array) for array in arrays)
    leaders = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, 4 * len(patches))
    squares = -(-patches.resolution // (_SQUARES * width)) * _SQUARES
    group = group_patches.group(_SQUARES, _SQUARES, 1)
    group_patches(
        compute.queue, (squares, squares, len(patch_scene.texel_to_patch)), group,
        lookup, np.int32(patches.resolution), np.int32(width), texels, materials, rays.receivers,
        light, np.float32(radiance.mean(dtype=np.float64)), apart, leaders,
    )  # fmt: skip
    result = np.empty(len(patches), np.uint32)
    cl.enqueue_copy(compute.queue, result, leaders)
    if mapped is not None:
        result[mapped:] = np.arange(mapped, len(result), dtype=np.uint32)
    elif patch_scene.triangles.backs is not None:
        backs = np.flatnonzero(patch_scene.geometry.triangle >= patch_scene.triangles.solid)
        result[backs] = backs
    return result
