"""Final lightmap images by OpenCL: the least-squares fit and fill of `FinalImages` on the device."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..device.buffers import unfilled, upload_float4, upload_once
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..patches.seams import Seams
from .device_bilinear_equations import DeviceBilinearEquations
from .device_bilinear_fit import DeviceBilinearFit
from .device_fill import SOURCE, DeviceFill
from .device_images import DeviceImages, DeviceTexels, texels_of
from .final_images import RINGS
from .lightmap_points import LightmapPoints


class DeviceFinalImages:
    """Final lightmaps from light at points; see `FinalImages`.

    centres:     (atlases, r, r) bool, texels with a light sample at their centre
    off_centre:  off-centre samples, ordered by the texel in which they lie
    has_patch:   (atlases, r, r) bool, texels that are patches

    The masks must not be changed, since their uploads are cached.
    """

    def __init__(
        self,
        compute: ComputeDevice,
        centres: np.ndarray,
        off_centre: LightmapPoints,
        seams: Seams,
        has_patch: np.ndarray,
        dilation: int,
    ) -> None:
        self._compute = compute
        equations = DeviceBilinearEquations(compute, centres, off_centre, seams)
        self._fit = DeviceBilinearFit(compute, equations) if equations.count else None
        known = self._with_texels(equations.centre, equations.texels, equations.count)
        surface = self._with_texels(equations.centre, equations.owners, equations.points)
        atlases, height, width = centres.shape
        inside = upload_once(compute, has_patch)
        fill = DeviceFill(compute, (atlases, height, width), known, surface, inside, RINGS, dilation)
        self._images = DeviceImages(compute, centres, fill)

    def _with_texels(self, mask: cl.Buffer, texels: cl.Buffer, count: int) -> cl.Buffer:
        """Return a copy of a mask, uchar for each texel, with `count` more texels, uint flat indices."""
        if not count:
            return mask
        compute = self._compute
        (mark,) = compute.kernels(SOURCE, "mark_texels")
        more = unfilled(compute, mask.size)
        cl.enqueue_copy(compute.queue, more, mask, byte_count=mask.size)
        compute.run(mark, count, texels, more, np.int32(count))
        return more

    def images(self, texels: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return the final lightmaps, (atlases, r, r, 3) float32.

        texels:  (atlases, r, r, 3) or (atlases, r, r, 1) float32, light at texel centres
        values:  (s, 3) or (s, 1) float32, light at the off-centre points
        """
        shown = texels_of(self._compute, texels)
        some = values if len(values) else np.zeros((1, 3), np.float32)
        light = upload_float4(self._compute, np.broadcast_to(some, (len(some), 3)))
        shown.shown_with(light, len(some))
        images: np.ndarray = self.images_of([shown], light)[0]
        return images

    @property
    def most(self) -> int:
        """Number of outputs whose images fit into the memory limit at the same time."""
        return self._images.most

    def images_of(self, outputs: Sequence[DeviceTexels], light: cl.Buffer) -> np.ndarray:
        """Return the final lightmaps of several outputs, (outputs, atlases, r, r, 3) float32.

        outputs:  light at texel centres of each output
        light:    float4 for each off-centre point, one output after the other
        """
        self._images.load(outputs)
        if self._fit is not None:
            self._fit.fit(self._images.buffer, light, [texels.largest for texels in outputs])
        return self._images.filled()
