"""Values of supersampled texels: mean of the valid samples, extrapolated to the texel centre."""

from __future__ import annotations

import numpy as np

from ..device.buffers import download, upload, upload_once, upload_rows_once, zeros
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from .device_images import NOWHERE, DeviceTexels
from .lightmap_points import SOURCE
from .texel_samples import TexelSamples

_NAMES = (
    "list_samples", "look_at_texels", "mark_cut", "mark_extrapolated", "texel_means", "range_of_all",
    "fit_planes",
    "extrapolate_texels", "begin_fit", "step_of_fit",
)  # fmt: skip

#: Flags of texels, as in kernels/postprocess/texel_means.cl.
_SEEN, _CUT, _BEYOND = 1, 8, 16

#: Texels that each work item reads in the reduction to minimum and maximum, as in the kernel.
_EACH = 32

#: Iterations of the fit of texels to samples (Jacobi: all texels change together).
_STEPS = 3

#: Initial value of the min/max reduction: minimum and maximum of four channels, floats as order-preserving
#: integers.
_NO_RANGE = np.repeat(np.array([0x7FFFFFFF, -0x80000000], np.int64).astype(np.int32), 4)


class TexelMeans:
    """Area-weighted means of the samples of each texel, on the OpenCL device.

    Geometry that cuts a texel moves the mean of its valid samples off the centre. A plane through the valid
    samples of 3 x 3 texels extrapolates the mean to the centre. Lookups in mostly valid texels also read the
    invalid texels beyond them, which take the mean of these planes. Extrapolated texels and texels with few
    valid samples are then fitted so that bilinear lookups match the samples, by least squares (Kavan,
    Bargteil and Sloan 2011).

    samples:  samples of all texels, at least one
    visible:  (s,) bool, valid samples; texels without any are filled as invalid
    shape:    (atlases, r, r)
    texels:   (k,) int64, flat indices of texels with valid samples
    invalid:  (h,) int64, flat indices of texels whose samples are all invalid
    beyond:   (b,) int64, texels of `invalid` that are next to a mostly valid texel
    """

    def __init__(
        self, compute: ComputeDevice, samples: TexelSamples, visible: np.ndarray, shape: tuple[int, ...]
    ) -> None:
        self._compute, self._resolution = compute, np.int32(shape[1])
        self._kernels = dict(zip(_NAMES, compute.kernels(SOURCE, *_NAMES), strict=True))
        texels, self._count = samples.texels(shape[1]), len(samples.starts)
        firsts = np.append(samples.starts, len(samples)).astype(np.int32)
        self._samples, self._firsts = self._buffer(16 * len(samples)), upload(compute, firsts)
        listed = [upload_once(compute, array) for array in (samples.position, samples.weight)]
        listed.append(upload(compute, np.asarray(visible, np.uint8)))
        count = np.int32(len(samples))
        compute.run(self._kernels["list_samples"], len(samples), *listed, self._samples, count)

        # State of each texel and of its neighbours.
        self._places = upload(compute, texels.astype(np.uint32))
        self._numbers = zeros(compute, 4 * int(np.prod(shape)))
        self._seen_part, states, marked = (self._buffer(size * self._count) for size in (16, 1, 1))
        where = self._places, self._resolution, self._numbers, self._seen_part
        self._run("look_at_texels", self._samples, self._firsts, *where, states)
        beside = self._places, self._numbers, self._resolution
        self._run("mark_cut", *beside, states, marked)
        self._run("mark_extrapolated", *beside, marked, states)
        self._states, state = states, np.empty(self._count, np.uint8)
        cl.enqueue_copy(compute.queue, state, states)
        self._shown = np.concatenate([np.flatnonzero(state & mark > 0) for mark in (_SEEN, _BEYOND)])
        places = np.where(state & (_SEEN | _BEYOND), texels, NOWHERE).astype(np.uint32)
        self._shown_places, self._has_planes = upload(compute, places), bool((state & _CUT).any())
        seen = state & _SEEN > 0
        self.texels, self.invalid, self.beyond = texels[seen], texels[~seen], texels[state & _BEYOND > 0]

        # Buffers of the values in work: of each texel the mean light, minimum and maximum, and fitted planes.
        self._light, self._changed, self._low, self._high = (self._buffer(16 * self._count) for _ in range(4))
        self._planes = self._buffer(5 * 16 * self._count if self._has_planes else 16)
        self._steps = self._buffer(4 * self._count)

    @property
    def shown(self) -> np.ndarray:
        """Flat indices of the texels that get values, (k + b,) int64: `texels`, then `beyond`."""
        return np.concatenate([self.texels, self.beyond])

    def of(self, values: np.ndarray) -> np.ndarray:
        """Return the values of the texels `shown`, (k + b, c) float32.

        values:  (s, c) or (s,) float32, values of the samples, 1 or 3 channels; must not be changed, since
                 their upload is cached
        """
        channels = _channels(values)
        light: np.ndarray = download(self._compute, self._light_of(values), (self._count, 4))
        return light[self._shown, :channels]

    def show(self, texels: DeviceTexels, values: np.ndarray) -> None:
        """Write the values of the texels `shown` into `texels`, which is on the device."""
        texels.put(self._shown_places, self._light_of(values), self._count)

    def _light_of(self, values: np.ndarray) -> cl.Buffer:
        """Return the values of all texels on the device, float4; 0 in texels that are not `shown`."""
        given = self._given(values)
        ranges = self._low, self._high
        self._run("texel_means", self._samples, self._firsts, self._seen_part, *given, self._light, *ranges)
        if not self._has_planes:
            return self._light
        limits = upload(self._compute, _NO_RANGE)
        self._compute.run(
            self._kernels["range_of_all"], -(-self._count // _EACH), *ranges, limits, np.int32(self._count)
        )
        beside = self._places, self._numbers, self._resolution, self._states
        samples = self._samples, self._firsts, *beside
        self._run(
            "fit_planes", *samples, self._seen_part, *given, *ranges, limits, self._light, self._planes
        )  # fmt: skip
        self._run("extrapolate_texels", *beside, self._planes, self._light)
        self._run("begin_fit", *samples, *given, limits, self._light, *ranges, self._steps)
        light, changed = self._light, self._changed
        for _ in range(_STEPS):
            self._run("step_of_fit", *samples, *given, *ranges, self._steps, light, changed)
            light, changed = changed, light
        return light

    def _given(self, values: np.ndarray) -> tuple[cl.Buffer, np.int32]:
        """Return the cached buffer of values of the samples, and the floats of each row: 1 for scalars."""
        if _channels(values) == 1:
            return upload_once(self._compute, values.astype(np.float32, copy=False)), np.int32(1)
        buffer, stride = upload_rows_once(self._compute, values)
        return buffer, np.int32(stride)

    def _buffer(self, size: int) -> cl.Buffer:
        return cl.Buffer(self._compute.context, cl.mem_flags.READ_WRITE, size)

    def _run(self, name: str, *arguments: object) -> None:
        """Run a kernel for each texel with samples."""
        self._compute.run(self._kernels[name], self._count, *arguments, np.int32(self._count))


def _channels(values: np.ndarray) -> int:
    return values.shape[1] if values.ndim == 2 else 1
