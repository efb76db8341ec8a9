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
from .chart_raster import Drawing, locked_copy, render_charts
from .patch_kernels import OPTIONS, SOURCE

#: Texels of each work item, as in kernels/patches/list_patches.cl.
SEGMENT = 32


class DeviceCharts:
    """Drawings of all atlases of a scene on the device, images of (atlases, r, r) texels."""

    def __init__(
        self,
        graphics: GraphicsContext,
        compute: ComputeDevice,
        triangles: Triangles,
        atlases: int,
        resolution: int,
    ) -> None:
        self.compute, self.triangles, self.atlases, self.resolution = compute, triangles, atlases, resolution
        self.texels = resolution**2
        self._graphics = graphics

    def drawn(self, drawing: Drawing) -> list[cl.Buffer]:
        """Draw all atlases; return a buffer for each target.

        The first one has the triangle + 1 of each texel, uint32, 0 where nothing is drawn. Others are
        undefined there.
        """
        sizes = [self.texels * components * int(kind[1]) for components, kind in drawing.targets]
        numbers, *others = (self.atlases * size for size in sizes)
        buffers = [zeros(self.compute, numbers), *(unfilled(self.compute, size) for size in others)]
        for atlas in range(self.atlases):
            chosen = self.triangles.in_atlas(atlas)

            def read(number: int, target: moderngl.Texture, atlas: int = atlas) -> None:
                self._upload(target, buffers[number], atlas * sizes[number])

            render_charts(
                self._graphics, drawing, take_rows(self.triangles.uvs, chosen), self.resolution, read
            )
            self._number_triangles(buffers[0], atlas, chosen)
        return buffers

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

    def _number_triangles(self, numbers: cl.Buffer, atlas: int, chosen: slice | np.ndarray) -> None:
        """Replace the numbers of drawn triangles of an atlas by triangles + 1."""
        is_range = isinstance(chosen, slice)
        start = chosen.start if isinstance(chosen, slice) else 0
        if is_range and start == 0:
            return
        order = numbers if isinstance(chosen, slice) else upload(self.compute, chosen.astype(np.int32))
        (kernel,) = self.compute.kernels(SOURCE, "number_triangles", options=OPTIONS)
        arguments = np.int32(atlas * self.texels), np.int32(start), order, np.int32(not is_range)
        self.compute.run(kernel, self.texels, numbers, *arguments, np.int32(self.texels))


def entries_before(
    compute: ComputeDevice, entries: cl.Buffer, images: int, texels: int, mask: cl.Buffer | None = None
) -> tuple[cl.Buffer, np.ndarray]:
    """Count the entries of images, (images, texels) uint32, that are not 0.

    Returns the number of entries before each segment of an image, int32 on the device, and the number of
    entries before each image and in all, (images + 1,) int64.

    mask:  (images, texels) uint32; entries count only where it is 0
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
