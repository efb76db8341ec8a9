"""Patch list on the OpenCL device, compacted from drawn charts."""

from __future__ import annotations

import math

import numpy as np

from ..device.buffers import unfilled, zeros
from ..device.device_rows import DeviceRows
from ..scene.model import Scene
from .device_charts import SEGMENT, DeviceCharts, entries_before
from .patch_kernels import OPTIONS, SOURCE
from .patch_list import DeviceTexelIndex, PatchList, nothing_covered


def list_patches_on(charts: DeviceCharts, scene: Scene) -> tuple[PatchList, DeviceRows]:
    """Compact the covered texels of drawn charts, as `list_patches` does.

    The second result is the number of patches on each triangle, (t,) int32. Raises SceneError if no texel
    centre is covered.
    """
    compute, atlases, texels = charts.compute, charts.atlases, charts.texels
    firsts, before = entries_before(compute, charts.numbers, atlases, texels)
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
    inputs = charts.numbers, charts.weights, firsts
    compute.run(kernel, -(-texels // SEGMENT), *inputs, *outputs, np.int32(texels), layers=atlases)
    index = DeviceTexelIndex(charts.resolution, np.diff(before), texel, own)
    return PatchList.on(index, triangle, barycentric), on_triangle
