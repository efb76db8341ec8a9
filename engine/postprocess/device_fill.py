"""Fill of lightmap texels without light by OpenCL: rings of dilation (`Dilation`), then `MembraneFill`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..device.cl_device import ComputeDevice
from ..device.opencl import cl

#: Kernel files of images and their fill, built as one program: faster than two builds.
SOURCE = ("gutter_fill.cl", "images.cl")

_NAMES = (
    "distance_in_row", "distance_in_column", "dilate_ring", "classify", "coarser_states", "restrict_mean",
    "prolongate",
    "relax", "fill_small",
)  # fmt: skip

#: Jacobi relaxations at each scale; an even number, so that the result ends in the image's own buffer.
_RELAXATIONS = 4

#: Image width up to which one kernel of a GPU fills all coarser scales, to save launches; its items per image
#: (chosen). Launches of a CPU are cheap, and it takes 0.4 to 0.8 s to compile the kernel (measured).
_SMALL, _GROUP = 32, 256


class _Scale(NamedTuple):
    """One scale of the image pyramid.

    shape:   atlases, height, width
    states:  uchar for each texel, see kernels/postprocess/gutter_fill.cl
    """

    shape: tuple[int, int, int]
    states: cl.Buffer


class DeviceFill:
    """Fill of unknown texels: rings of dilation, then a multigrid membrane.

    shape:    (atlases, r, r)
    known:    uchar for each texel, nonzero for texels that keep their bits
    surface:  uchar for each texel, nonzero for known texels that lie on a chart
    inside:   uchar for each texel, nonzero for texels that are filled at any distance
    rings:    number of dilation rings; a new texel is the mean of its chart neighbours, else of known ones
    reach:    distance in texels up to which texels are filled; farther texels are 0
    """

    def __init__(
        self,
        compute: ComputeDevice,
        shape: tuple[int, int, int],
        known: cl.Buffer,
        surface: cl.Buffer,
        inside: cl.Buffer,
        rings: int,
        reach: int,
    ) -> None:
        self._compute, self._rings = compute, min(rings, reach)
        self._kernels = dict(zip(_NAMES, compute.kernels(SOURCE, *_NAMES), strict=True))
        in_row, self._distance = (self._buffer(2, shape) for _ in range(2))
        self._surface = surface
        self._run("distance_in_row", shape, known, in_row, np.int32(reach))
        self._run("distance_in_column", shape, in_row, self._distance, np.int32(reach))
        states = self._buffer(1, shape)
        self._run("classify", shape, self._distance, inside, np.int32(self._rings), states)
        self._scales = [_Scale(shape, states)]
        self._fills_small = not compute.processor
        while max(shape[1:]) > (_SMALL if self._fills_small else 1):
            self._add_coarser()
            shape = self._scales[-1].shape
        self._texels = _coarser_texels(*shape[1:])
        self._coarse: list[cl.Buffer] = []
        self._small: list[cl.Buffer] = []
        self._reserve(1)

    def _reserve(self, outputs: int) -> None:
        """Allocate buffers for the images of `outputs` outputs."""
        self._outputs = outputs
        self._relaxed = self._buffer(16 * outputs, self._scales[0].shape)
        self._coarse = [self._buffer(16 * outputs, scale.shape) for scale in self._scales[1:]]
        images, texels = outputs * self._scales[0].shape[0], max(1, self._texels)
        self._small = [self._buffer(size, (images, texels)) for size in (1, 16)]

    def fill(self, image: cl.Buffer, outputs: int) -> None:
        """Fill the images of `outputs` outputs in place, one after the other, float4 for each texel."""
        if outputs != self._outputs:
            self._reserve(outputs)
        for ring in range(1, self._rings + 1):
            self._fill(
                "dilate_ring", self._scales[0].shape, self._distance, self._surface, np.int32(ring), image
            )
        images = [image, *self._coarse]
        for index, scale in enumerate(self._scales[1:]):
            finer = self._scales[index]
            self._fill(
                "restrict_mean", scale.shape, finer.states, images[index], *_sides(finer), images[index + 1]
            )
        if self._fills_small:
            self._fill_small(images[-1])
        for index in reversed(range(len(self._scales) - 1)):
            self._extend(index, images[index], images[index + 1])

    def _fill_small(self, image: cl.Buffer) -> None:
        """Fill the coarsest scale that has buffers; one kernel computes it and all scales below."""
        scale, (group,) = self._scales[-1], self._kernels["fill_small"].group(_GROUP)
        atlases = scale.shape[0]
        sizes = (_RELAXATIONS, self._texels, atlases, scale.shape[2], scale.shape[1])
        self._kernels["fill_small"](
            self._compute.queue, (group * self._outputs * atlases,), (group,),
            scale.states, image, *self._small, self._relaxed, *map(np.int32, sizes),
        )  # fmt: skip

    def _extend(self, index: int, image: cl.Buffer, coarse: cl.Buffer) -> None:
        """Interpolate the unknown texels of scale `index` from the next coarser scale, then relax them."""
        scale, coarser = self._scales[index : index + 2]
        self._fill("prolongate", scale.shape, scale.states, coarse, *_sides(coarser), image)
        images = image, self._relaxed
        for number in range(_RELAXATIONS):
            before, after = images[number % 2], images[1 - number % 2]
            self._fill("relax", scale.shape, scale.states, image, before, after)

    def _add_coarser(self) -> None:
        finer = self._scales[-1]
        images, height, width = finer.shape
        shape = (images, (height + 1) // 2, (width + 1) // 2)
        scale = _Scale(shape, self._buffer(1, shape))
        self._run("coarser_states", shape, finer.states, *_sides(finer), scale.states)
        self._scales.append(scale)

    def _buffer(self, size: int, shape: tuple[int, ...]) -> cl.Buffer:
        """Return a buffer of `size` bytes for each texel."""
        return cl.Buffer(self._compute.context, cl.mem_flags.READ_WRITE, size * int(np.prod(shape)))

    def _run(self, name: str, shape: tuple[int, ...], *arguments: object) -> None:
        """Run a kernel with one work item for each texel of the atlases."""
        self._compute.run_texels(self._kernels[name], shape, *arguments)

    def _fill(self, name: str, shape: tuple[int, int, int], *arguments: object) -> None:
        """Run a kernel with one work item for each texel of the images of all outputs."""
        atlases, *sides = shape
        self._run(name, (self._outputs * atlases, *sides), *arguments, np.uint32(atlases))


def _coarser_texels(height: int, width: int) -> int:
    """Return the number of texels of all coarser scales of an image, down to one texel."""
    texels = 0
    while max(height, width) > 1:
        height, width = (height + 1) // 2, (width + 1) // 2
        texels += height * width
    return texels


def _sides(scale: _Scale) -> tuple[np.int32, np.int32]:
    """Return the width and height of the images of a scale."""
    return np.int32(scale.shape[2]), np.int32(scale.shape[1])
