"""Texture filtering over texels: mean of a texture over each patch's texel (OpenCL)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..device.buffers import upload
from ..device.cl_device import ComputeDevice
from ..device.device_array import DeviceArray, Values
from ..device.opencl import cl
from ..scene.cutouts import EXTENSIONS
from ..scene.model import Mesh
from ..scene.texture import Texture
from .geometry import PatchGeometry
from .patch_kernels import OPTIONS, SOURCE
from .textured import TexturedPatches, averaged_size

#: Maximum bytes of an image strip that the box filter reduces in one step.
_STRIP = 1 << 26


class TextureMeans:
    """Multiplication of patch values by texture means over their texels.

    A texel has 4 x 4 sample points; only points inside the patch's triangle count. Images with finer pixels
    are first reduced by a box filter.
    """

    def __init__(self, compute: ComputeDevice, geometry: PatchGeometry, meshes: Sequence[Mesh]) -> None:
        self._compute, self._geometry, self._meshes = compute, geometry, meshes
        self._points = geometry.on_device(compute)
        self._image: tuple[tuple, cl.Buffer] | None = None
        names = "texture_mean", "downsample"
        self._mean, self._shrink = compute.kernels(SOURCE, *names, options=OPTIONS)

    def multiply(self, values: Values, maps: Sequence[tuple[TexturedPatches, Texture]]) -> None:
        """Multiply values of patches, (n, 3) float32, in place by textures of their materials."""
        if not maps:
            return
        places = np.zeros(len(self._geometry.triangles.material), np.int32)
        for textured, _ in maps:
            places[textured.triangles] = np.arange(len(textured.triangles))
        inputs = (*self._points, upload(self._compute, places))
        buffer = values.buffer if isinstance(values, DeviceArray) else upload(self._compute, values)
        for textured, texture in sorted(maps, key=lambda both: id(both[1].pixels)):
            self._multiply(buffer, inputs, textured, texture)
        if isinstance(values, np.ndarray):
            cl.enqueue_copy(self._compute.queue, values, buffer)

    def _multiply(
        self, values: cl.Buffer, inputs: tuple[cl.Buffer, ...], textured: TexturedPatches, texture: Texture
    ) -> None:
        """Multiply the values of one material's patches by the mean of its texture over each texel."""
        count = len(textured.patch)
        corners = textured.corners(self._meshes, texture)
        side = textured.squares(corners, texture)
        height, width = averaged_size(texture, side)
        arrays = (textured.patch.astype(np.int32), textured.steps.astype(np.float32), corners)
        self._compute.run(
            self._mean, count, *inputs, *(upload(self._compute, array) for array in arrays),
            self._averaged(texture, side), np.int32(width), np.int32(height),
            np.int32(EXTENSIONS.index(texture.extension)), np.int32(texture.smooth),
            np.int32(texture.srgb and side == 1), values, np.int32(count),
        )  # fmt: skip

    def _averaged(self, texture: Texture, side: int) -> cl.Buffer:
        """Return the pixels of a texture reduced by a box filter of `side` x `side` pixels.

        The device stores one image at a time; consecutive materials with the same image share it.
        """
        key = id(texture.pixels), side, texture.srgb
        if self._image is None or self._image[0] != key:
            self._compute.queue.finish()
            self._image = None
            pixels = self._shrunk(texture, side) if side > 1 else upload(self._compute, texture.pixels)
            self._image = key, pixels
        return self._image[1]

    def _shrunk(self, texture: Texture, side: int) -> cl.Buffer:
        """Return a texture on the device, reduced by a box filter of `side` x `side` pixels."""
        (height, width), (rows, columns) = texture.pixels.shape[:2], averaged_size(texture, side)
        image = cl.Buffer(self._compute.context, cl.mem_flags.READ_WRITE, 12 * rows * columns)
        at_once = max(1, _STRIP // (12 * width * side))
        for row in range(0, rows, at_once):
            count = min(at_once, rows - row)
            first, last = row * height // rows, -(-(row + count) * height // rows)
            self._compute.run(
                self._shrink, count * columns, upload(self._compute, texture.pixels[first:last]),
                np.int32(first), np.int32(width), np.int32(height), np.int32(columns), np.int32(rows),
                np.int32(texture.srgb), image, np.int32(row * columns), np.int32(count * columns),
            )  # fmt: skip
        return image
