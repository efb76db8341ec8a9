"""What texels show that have several display samples: the mean of those that are seen."""

from __future__ import annotations

import numpy as np

from ..device.buffers import download, upload, upload_once, zeros
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..sorted_runs import run_starts
from .device_images import NOWHERE, DeviceTexels
from .texel_samples import TexelSamples

_NAMES = (
    "list_samples", "look_at_texels", "mark_cut", "mark_extrapolated", "texel_means", "range_of_all",
    "fit_planes",
    "extrapolate_texels", "begin_fit", "step_of_fit",
)  # fmt: skip

#: Marks of kernels/postprocess/texel_means.cl.
_SEEN, _CUT, _BEYOND = 1, 8, 16

#: Texels that a work item looks at for the range of all values, as there.
_EACH = 32

#: Times that the display is compared with the samples: neighbours are read together.
_STEPS = 3

#: Before any value, as integers in the order of numbers: least and most of four channels.
_NO_RANGE = np.repeat(np.array([0x7FFFFFFF, -0x80000000], np.int64).astype(np.int32), 4)


class TexelMeans:
    """Means over the samples of each texel, weighted by area, on the OpenCL device.

    samples  of all texels; there is one at least
    visible  (s,) bool, samples that somebody sees; texels without any are filled as hidden ones
    shape    atlases, r, r

    texels   (k,) int64, atlas * r * r + texel, that have samples that are seen
    hidden   (h,) int64, those none of whose samples is seen
    beyond   (b,) int64, hidden ones beside texels that are seen for the greater part

    What is seen of a texel that something cuts lies beside its centre: its mean goes on to there by the slope
    of a plane through the samples of 3 x 3 texels. Where most of it is seen, texels beyond it are read, too:
    they show the mean of the planes around such texels beside them. Where light bends, they and texels that
    are hardly seen get what makes the display right at the samples, by least squares (Kavan, Bargteil and
    Sloan 2011).
    """

    def __init__(
        self, compute: ComputeDevice, samples: TexelSamples, visible: np.ndarray, shape: tuple[int, ...]
    ) -> None:
        self._compute, self._resolution = compute, np.int32(shape[1])
        self._kernels = dict(zip(_NAMES, compute.kernels("texel_means.cl", *_NAMES), strict=True))
        keys = samples.keys(shape[1])
        starts = run_starts(keys)
        texels, self._count = keys[starts], len(starts)
        firsts = np.append(starts, len(keys)).astype(np.int32)
        self._samples, self._firsts = self._buffer(16 * len(keys)), upload(compute, firsts)
        listed = [upload_once(compute, array) for array in (samples.position, samples.weight)]
        listed.append(upload(compute, np.asarray(visible, np.uint8)))
        compute.run(self._kernels["list_samples"], len(keys), *listed, self._samples, np.int32(len(keys)))

        # What is known of each texel, and which ones are beside it.
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
        self._shown = np.concatenate([np.flatnonzero(state & mark) for mark in (_SEEN, _BEYOND)])
        places = np.where(state & (_SEEN | _BEYOND), texels, NOWHERE).astype(np.uint32)
        self._shown_places, self._has_planes = upload(compute, places), bool((state & _CUT).any())
        seen = state & _SEEN > 0
        self.texels, self.hidden, self.beyond = texels[seen], texels[~seen], texels[state & _BEYOND > 0]

        # Each texel's light, range, and planes, of the values at hand.
        self._light, self._changed, self._low, self._high = (self._buffer(16 * self._count) for _ in range(4))
        self._planes = self._buffer(5 * 16 * self._count if self._has_planes else 16)
        self._steps = self._buffer(4 * self._count)

    @property
    def shown(self) -> np.ndarray:
        """Texels that `of` has light of: `texels`, then those `beyond`, (k + b,) int64."""
        return np.concatenate([self.texels, self.beyond])

    def of(self, values: np.ndarray) -> np.ndarray:
        """Return the light of texels that are `shown`, (k + b, c) float32.

        values: (s, c) or (s,), of the samples; 1 or 3 channels
        """
        channels = _channels(values)
        light: np.ndarray = download(self._compute, self._light_of(values), (self._count, 4))
        return light[self._shown, :channels]

    def show(self, texels: DeviceTexels, values: np.ndarray) -> None:
        """Let texels show the light of those that are `shown`; values as of `of`."""
        texels.put(self._shown_places, self._light_of(values), self._count)

    def _light_of(self, values: np.ndarray) -> cl.Buffer:
        """Return the light of all texels, float4; 0 of those that are not shown. Values as of `of`."""
        channels = np.int32(_channels(values))
        given = upload(self._compute, values.astype(np.float32, copy=False)), channels
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

    def _buffer(self, size: int) -> cl.Buffer:
        return cl.Buffer(self._compute.context, cl.mem_flags.READ_WRITE, size)

    def _run(self, name: str, *arguments: object) -> None:
        """Run a kernel for each texel that has samples."""
        self._compute.run(self._kernels[name], self._count, *arguments, np.int32(self._count))


def _channels(values: np.ndarray) -> int:
    return values.shape[1] if values.ndim == 2 else 1
