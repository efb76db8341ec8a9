"""Charts on the OpenCL device: drawn images, and ascending lists of their texels."""

from __future__ import annotations

import moderngl
import numpy as np

from ..array_ops import take_rows
from ..device.buffers import download, unfilled, upload, zeros
from ..device.cl_device import ComputeDevice
from ..device.device_rows import DeviceRows
from ..device.gl_context import GraphicsContext
from ..device.opencl import cl
from ..scene.triangles import Triangles
from .chart_raster import (
    ALIGNED,
    OVERLAP,
    PATCHES,
    TOUCHED,
    draw_charts,
    locked_copy,
    read_target,
    render_charts,
)
from .patch_kernels import OPTIONS, SOURCE

#: Texels of each work item, as in kernels/patches/list_patches.cl.
SEGMENT = 32

#: Bytes of a covered texel in the largest buffer and in all, with its patch before and after it is inset, and
#: maximum fraction of the device's memory for them (chosen). Kernels number texels by int32.
_LARGEST, _ALL, _FRACTION, _MOST_TEXELS = 12, 48, 1 / 2, 1 << 31


def fits_device(compute: ComputeDevice, texels: int) -> bool:
    """Return True if the drawings and patches of that many texels fit the device."""
    device = compute.device
    return (
        0 < texels < _MOST_TEXELS
        and _LARGEST * texels <= device.max_mem_alloc_size
        and _ALL * texels <= _FRACTION * device.global_mem_size
    )


class DeviceCharts:
    """Drawings of all atlases of a scene on the device, images of (atlases, r, r) texels.

    numbers:  triangle + 1 of each texel, uint32: the triangle that covers its centre, or else the nearest one
              that touches it, with `ONLY_TOUCHED`; 0 for none
    weights:  two barycentrics of the centre on a triangle that covers it, float32
    counts:   (h, r) uint8 of each atlas on the host, number of triangles that cover each centre in the first
              h rows
    """

    def __init__(
        self,
        graphics: GraphicsContext,
        compute: ComputeDevice,
        triangles: Triangles,
        atlases: int,
        resolution: int,
        align: bool = False,
    ) -> None:
        self.compute, self.triangles, self.atlases, self.resolution = compute, triangles, atlases, resolution
        self.texels = resolution**2
        self.numbers = zeros(compute, 4 * atlases * self.texels)
        self.weights = unfilled(compute, 8 * atlases * self.texels)
        self.counts = [self._draw(graphics, atlas, align) for atlas in range(atlases)]

    def _draw(self, graphics: GraphicsContext, atlas: int, align: bool) -> np.ndarray:
        """Draw an atlas; return its image of `counts`."""
        chosen = self.triangles.in_atlas(atlas)
        uvs = take_rows(self.triangles.uvs, chosen)
        counts = np.zeros((0, self.resolution), np.uint8)

        def read(number: int, target: moderngl.Texture) -> None:
            nonlocal counts
            if number < 2:
                buffer, size = ((self.numbers, 4), (self.weights, 8))[number]
                self._upload(target, buffer, size * atlas * self.texels)
            elif not align:
                counts = read_target(target).reshape(-1, self.resolution)

        render_charts(graphics, [TOUCHED, ALIGNED if align else PATCHES], uvs, self.resolution, read)
        self._number_triangles(atlas, chosen)
        if align:
            (counts,) = draw_charts(graphics, OVERLAP, uvs, self.resolution)
        return counts.reshape(-1, self.resolution)

    def _upload(self, target: moderngl.Texture, buffer: cl.Buffer, at: int) -> None:
        """Copy a render target into a buffer from byte `at` on."""
        copy = locked_copy(target)
        if self.compute.is_staged(copy.size):
            staging = self.compute.staging
            staging.fill(buffer, copy.size, lambda part, first: copy.read_into(part, len(part), first), at)
        else:
            image = np.frombuffer(copy.read(), np.uint8)
            cl.enqueue_copy(self.compute.queue, buffer, image, dst_offset=at)
        copy.release()

    def _number_triangles(self, atlas: int, chosen: slice | np.ndarray) -> None:
        """Replace the numbers of drawn triangles of an atlas by triangles + 1."""
        is_range = isinstance(chosen, slice)
        start = chosen.start if isinstance(chosen, slice) else 0
        if is_range and start == 0:
            return
        order = self.numbers if isinstance(chosen, slice) else upload(self.compute, chosen.astype(np.int32))
        (kernel,) = self.compute.kernels(SOURCE, "number_triangles", options=OPTIONS)
        arguments = np.int32(atlas * self.texels), np.int32(start), order, np.int32(not is_range)
        self.compute.run(kernel, self.texels, self.numbers, *arguments, np.int32(self.texels))


def entries_before(
    compute: ComputeDevice, entries: cl.Buffer, images: int, texels: int, mask: cl.Buffer | None = None
) -> tuple[cl.Buffer, np.ndarray]:
    """Count the entries of images, (images, texels) uint32, that are not 0 and lack `ONLY_TOUCHED`.

    Returns the number of entries before each segment of an image, int32 on the device, and the number of
    entries before each image and in all, (images + 1,) int64.

    mask:  (images, texels) uint32; if given, all entries count that are not 0 where the mask is 0
    """
    segments = -(-texels // SEGMENT)
    counts = unfilled(compute, 4 * images * segments)
    (kernel,) = compute.kernels(SOURCE, "count_entries", options=OPTIONS)
    masked = (entries, np.int32(0)) if mask is None else (mask, np.int32(1))
    compute.run(kernel, segments, entries, *masked, counts, np.int32(texels), layers=images)
    ends = np.cumsum(download(compute, counts, (images * segments,)).view(np.int32), dtype=np.int64)
    firsts = np.append(0, ends)
    return upload(compute, firsts[:-1].astype(np.int32)), firsts[:: max(segments, 1)]


def listed_entries(
    compute: ComputeDevice, entries: cl.Buffer, images: int, texels: int, mask: cl.Buffer | None = None
) -> tuple[DeviceRows, DeviceRows]:
    """List the entries of images that `entries_before` counts, in ascending order.

    Returns the place and the value - 1 of each entry, two (k,) int32.
    """
    firsts, before = entries_before(compute, entries, images, texels, mask)
    count = int(before[-1])
    buffers = [unfilled(compute, 4 * max(count, 1)) for _ in range(2)]
    if count:
        (kernel,) = compute.kernels(SOURCE, "list_entries", options=OPTIONS)
        masked = (entries, np.int32(0)) if mask is None else (mask, np.int32(1))
        segments = -(-texels // SEGMENT)
        compute.run(kernel, segments, entries, *masked, firsts, *buffers, np.int32(texels), layers=images)
    places, values = (DeviceRows(compute, buffer, (count,), np.int32) for buffer in buffers)
    return places, values
