"""Patch list on the OpenCL device, compacted from drawn charts."""

from __future__ import annotations

import math

import numpy as np

from ..device.buffers import unfilled, zeros
from ..device.device_rows import DeviceRows
from ..scene.model import Scene
from .chart_raster import ALIGNED, PATCHES
from .device_charts import SEGMENT, DeviceCharts, entries_before
from .patch_kernels import OPTIONS, SOURCE
from .patch_list import DeviceTexelIndex, PatchList, nothing_covered


def list_patches_on(charts: DeviceCharts, scene: Scene, align: bool) -> tuple[PatchList, DeviceRows]:
    """Rasterize the lightmap UVs of each atlas and compact the covered texels, as `list_patches` does.

    The second result is the number of patches on each triangle, (t,) int32. Raises SceneError if no texel
    centre is covered.
    """
    compute, atlases, texels = charts.compute, charts.atlases, charts.texels
    numbers, weights = charts.drawn(ALIGNED if align else PATCHES)
    firsts, before = entries_before(compute, numbers, atlases, texels)
    count = int(before[-1])
    if not count:
        raise nothing_covered(scene, charts.resolution)

    def rows(shape: tuple[int, ...], dtype: type[np.generic]) -> DeviceRows:
        return DeviceRows(compute, unfilled(compute, 4 * math.prod(shape)), shape, dtype)

    triangles = len(charts.triangles.mesh)
    texel, triangle, barycentric = (
        rows((count,), np.int32),
        rows((count,), np.int32),
        rows((count, 3), np.float32),
    )
    own = rows((atlases, charts.resolution, charts.resolution), np.uint32)
    on_triangle = DeviceRows(compute, zeros(compute, 4 * triangles), (triangles,), np.int32)
    (kernel,) = compute.kernels(SOURCE, "list_patches", options=OPTIONS)
    outputs = (column.buffer for column in (texel, triangle, barycentric, own, on_triangle))
    inputs = numbers, weights, firsts
    compute.run(kernel, -(-texels // SEGMENT), *inputs, *outputs, np.int32(texels), layers=atlases)
    index = DeviceTexelIndex(charts.resolution, np.diff(before), texel, own)
    return PatchList.on(index, triangle, barycentric), on_triangle
