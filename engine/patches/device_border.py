"""Patches of border texels, on the OpenCL device."""

from __future__ import annotations

import math

import numpy as np

from ..device.buffers import lasting_buffer, unfilled, upload
from ..device.cl_device import ComputeDevice
from ..device.device_rows import DeviceRows, Rows, device_rows
from ..device.opencl import cl
from .border_texels import OFFSETS, BorderTexels
from .device_charts import listed_entries
from .geometry import PatchGeometry
from .patch_kernels import OPTIONS, SOURCE
from .patch_list import DeviceTexelIndex, PatchList


class DeviceBorder:
    """Search for patches near border texels, and new patches there, on the OpenCL device."""

    def __init__(self, compute: ComputeDevice, geometry: PatchGeometry, border: BorderTexels) -> None:
        self._compute, self._count = compute, len(border)
        names = "nearest_patches", "thin_patches", "insert_patches", "fill_border"
        kernels = compute.kernels(SOURCE, *names, options=OPTIONS)
        self._nearest, self._thin, self._insert, self._fill = kernels
        (self._insert_rows,) = compute.kernels("float4_rows.cl", "insert_rows")
        self._texels, self._owners = (
            device_rows(compute, rows) for rows in (border.texel_rows, border.triangle_rows)
        )
        triangles, offsets = geometry.triangles, np.array(OFFSETS, np.int32)[:, ::-1]
        arrays = triangles.uvs, triangles.positions, triangles.mesh, geometry.steps.longer
        self._uvs, *scene = (lasting_buffer(compute, array) for array in arrays)
        self._scene = [*scene, upload(compute, offsets)]

    def nearest_patches(self, patches: PatchList, entries: Rows) -> tuple[DeviceRows, DeviceRows, DeviceRows]:
        """Find the nearest patch on the surface of each border texel; return three (m,) uint32.

        A patch is on the surface of a texel if its triangle belongs to the same mesh, and if it is at most
        twice as far away in the world as on the lightmap. The first array has the number of that patch + 1,
        or 0 without one. The second is 1 if the point of the texel's triangle nearest to the texel's centre
        lies inside the texel. The third is 1 if the second is 1 and the first is 0.

        entries:  (atlases, r, r) uint32, see `PatchList.on_texels`
        """
        outputs = [self._rows((self._count,), np.uint32) for _ in range(3)]
        arrays = entries, patches.triangle_rows, patches.barycentric_rows
        inputs = (device_rows(self._compute, rows) for rows in arrays)
        self._compute.run(
            self._nearest, self._count, self._texels, self._owners, self._uvs, *self._scene,
            np.int32(len(OFFSETS)), np.int32(patches.resolution), *inputs,
            *(rows.buffer for rows in outputs), np.int32(self._count),
        )  # fmt: skip
        nearest, inside, thin = outputs
        return nearest, inside, thin

    def listed(self, marks: DeviceRows) -> DeviceRows:
        """Return the indices of marked border texels, (k,) int32."""
        return listed_entries(self._compute, marks.buffer, 1, self._count)[0]

    def with_thin(
        self, patches: PatchList, entries: Rows, counts: Rows, chosen: DeviceRows
    ) -> tuple[PatchList, DeviceRows]:
        """Add a patch at each chosen border texel; return all patches, and their number on each triangle.

        A new patch lies at the centroid of the covered part of its texel. Rays from a point on an edge would
        miss adjacent surfaces.

        entries:  (atlases, r, r) uint32, see `PatchList.on_texels`
        counts:   (t,) int32, number of patches on each triangle
        chosen:   (k,) int32, border texels of thin surfaces
        """
        compute, count, resolution = self._compute, len(chosen), patches.resolution
        keys, places, owners, rows = (self._rows((count,), np.int32) for _ in range(4))
        middles, on_triangle = self._rows((count, 3), np.float32), self._copied(counts)
        index = patches.index
        before = np.array([index.count_in(atlas) for atlas in range(len(entries) + 1)], np.int32)
        compute.run(
            self._thin, count, self._texels, self._owners, chosen.buffer, self._uvs, np.int32(resolution),
            device_rows(compute, index.texel_rows), upload(compute, before), keys.buffer, places.buffer,
            owners.buffer, middles.buffer, rows.buffer, on_triangle.buffer, np.int32(count),
        )  # fmt: skip
        added = np.bincount(keys.on_host // resolution**2, minlength=len(entries))
        own, texels = self._rows(entries.shape, np.uint32), entries.size
        arguments = keys.buffer, rows.buffer, np.int32(count), own.buffer, np.int32(texels)
        compute.run(self._insert, texels, device_rows(compute, entries), *arguments)
        columns = (
            (index.texel_rows, places),
            (patches.triangle_rows, owners),
            (patches.barycentric_rows, middles),
        )
        texel, triangle, barycentric = (self._inserted(old, new, rows) for old, new in columns)
        index = DeviceTexelIndex(resolution, np.diff(before) + added, texel, own)
        return PatchList.on(index, triangle, barycentric), on_triangle

    def filled(self, entries: Rows, nearest: DeviceRows) -> DeviceRows:
        """Return the index map, (atlases, r, r) uint32: border texels without a patch take the nearest."""
        filled, count = self._copied(entries), np.int32(self._count)
        self._compute.run(self._fill, self._count, self._texels, nearest.buffer, filled.buffer, count)
        return filled

    def _inserted(self, old: Rows, new: DeviceRows, rows: DeviceRows) -> DeviceRows:
        """Insert rows into a column of patches; rows: (k,) int32, ascending, their places in the result."""
        joined = self._rows((len(old) + len(new), *new.shape[1:]), new.dtype.type)
        sizes = np.int32(len(new)), np.int32(math.prod(new.shape[1:]))
        buffers = device_rows(self._compute, old), new.buffer, rows.buffer
        self._compute.run(
            self._insert_rows, len(joined), *buffers, *sizes, joined.buffer, np.int32(len(joined))
        )
        return joined

    def _rows(self, shape: tuple[int, ...], dtype: type[np.generic]) -> DeviceRows:
        size = 4 * math.prod(shape)
        return DeviceRows(self._compute, unfilled(self._compute, max(size, 4)), shape, dtype)

    def _copied(self, rows: Rows) -> DeviceRows:
        """Return a copy of rows on the device, 4 bytes each."""
        copy = self._rows(rows.shape, np.dtype(rows.dtype).type)
        source, size = device_rows(self._compute, rows), 4 * rows.size
        cl.enqueue_copy(self._compute.queue, copy.buffer, source, byte_count=size)
        return copy
