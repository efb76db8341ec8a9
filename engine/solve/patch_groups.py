"""Patch groups: bounces are computed for squares of patches, then every patch gathers once.

Light after several bounces is smooth, and only the sources of a final gather are averaged, so lightmaps keep
their detail. Patches that emit much more than their neighbours form groups of their own. An example is a
ceiling behind a panel: it is bright but hidden, and would replace the visible ceiling next to the panel.
Patches inside geometry stay separate too: they are dark, and would darken the floor around a sunken box.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..array_ops import has_nonzero, map_slabs, taken
from ..device.buffers import download, float4_of, upload, upload_once
from ..device.cl_device import ComputeDevice
from ..device.device_array import DeviceArray, Values
from ..device.device_rows import device_rows
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
        self.width, self._followed = width, representative
        self.representative = _leading(representative)
        self._patch_scene, self._area = patch_scene, area
        self._means = _GroupMeans(rays.compute, patch_scene, representative, self.representative, width)
        self.texel_to_group = self._means.texel_to_group()

    @cached_property
    def group(self) -> np.ndarray:
        """Group of each patch, (n,) int64."""
        return numbered(self._followed)[0]

    @cached_property
    def patch_scene(self) -> PatchScene:
        """The groups as a PatchScene, with mean materials and the geometry of the representatives."""
        patch_scene, representative = self._patch_scene, self.representative
        surfaces = PatchMaterials(
            self.mean(patch_scene.surfaces.reflectance),
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
            entries=self.texel_to_group,
            source_count=None,
        )

    @cached_property
    def area(self) -> np.ndarray:
        """Total area of the patches in each group, (m,) float32, m^2."""
        return self._means.of(self._area, total=True)

    def mean(self, values: Values) -> np.ndarray:
        """Return the mean of patch values over each group, (n, 3) or (n,) -> (m, 3) or (m,) float32."""
        if isinstance(values, np.ndarray) and not has_nonzero(values):
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
        self._texels, self._patches = patch_scene.texel_to_patch, len(representative)
        names = "group_means", "number_groups", "groups_of_texels"
        self._mean, self._number, self._groups_of = compute.kernels(SOURCE, *names)
        self._followed, self._leading = (
            upload(compute, representative),
            upload(compute, leading.astype(np.uint32)),
        )
        self._groups = (
            upload_once(compute, self._texels), np.int32(patches.resolution), np.int32(width),
            upload_once(compute, patches.texel), self._followed, self._leading,
            upload(compute, patches.atlas[leading]),
        )  # fmt: skip

    def of(self, values: Values, total: bool = False) -> np.ndarray:
        """Return the group means of values, (n, 3) or (n,), as (m, 3) or (m,) float32.

        total: True for the means times the members of each group
        """
        compute = self._compute
        shape = (values.channels,) if isinstance(values, DeviceArray) else values.shape[1:]
        rows, stride = self._rows(values)
        count = self._count * math.prod(shape)
        means = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, 4 * count)
        sizes = np.int32(stride), np.int32(math.prod(shape)), np.int32(total)
        compute.run(self._mean, count, *self._groups, rows, *sizes, means, np.uint32(count))
        return download(compute, means, (self._count, *shape))

    def _rows(self, values: Values) -> tuple[cl.Buffer, int]:
        """Return the buffer of values and the floats of its rows."""
        if isinstance(values, DeviceArray):
            return values.buffer, values.stride
        if values.ndim == 1:
            return upload(self._compute, values.astype(np.float32, copy=False)), 1
        return float4_of(self._compute, values), 4

    def texel_to_group(self) -> np.ndarray:
        """Return the group + 1 of each texel's patch, (atlases, r, r) uint32, 0 for none."""
        compute, texels = self._compute, self._texels
        numbers = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 4 * self._patches)
        compute.run(self._number, self._count, self._leading, numbers, np.int32(self._count))
        groups = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, texels.nbytes)
        arguments = upload_once(compute, texels), self._followed, numbers, groups
        compute.run(self._groups_of, texels.size, *arguments, np.uint32(texels.size))
        entries = download(compute, groups, texels.shape).view(np.uint32)
        compute.shared.of(entries, "bits", lambda: groups)
        return entries


def numbered(representative: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the group of each patch, (n,) int64, and the representative of each group, (m,) int64.

    representative:  (n,) uint32, representative of each patch
    """
    leading = _leading(representative)
    number = np.zeros(len(representative), np.int64)
    number[leading] = np.arange(len(leading))
    return taken(number, representative), leading


def _leading(representative: np.ndarray) -> np.ndarray:
    """Return the patches that represent themselves, (m,) int64."""
    leads = np.empty(len(representative), bool)

    def compare(rows: slice) -> None:
        own = np.arange(rows.start, rows.stop, dtype=np.uint32)
        np.equal(representative[rows], own, out=leads[rows])

    map_slabs(len(leads), 5, compare)
    return np.flatnonzero(leads)


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
    lookup, texels = (device_rows(compute, rows) for rows in (patch_scene.entries, patches.index.texel_rows))
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
    result = download(compute, leaders, (len(patches),)).view(np.uint32)
    if mapped is not None:
        result[mapped:] = np.arange(mapped, len(result), dtype=np.uint32)
    elif patch_scene.triangles.backs is not None:
        backs = np.flatnonzero(patch_scene.geometry.triangle >= patch_scene.triangles.solid)
        result[backs] = backs
    return result
