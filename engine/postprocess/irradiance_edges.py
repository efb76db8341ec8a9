"""Edge detection on irradiance and validity, which selects texels for supersampling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.buffers import download_bytes, unfilled, upload, upload_once, words_of
from ..device.cl_device import ComputeDevice
from ..device.device_array import Values, rows_on_device

#: Relative difference from the mean of the neighbours above which irradiance has an edge.
_EDGE = 0.1

#: The same around texels at a chart border. An edge between the last centre and the border crosses no other
#: centre; uneven light around it is the only sign.
_EDGE_NEAR_BORDER = 0.05

#: Fraction of the map's mean irradiance: darker texels are compared as if they had this value.
_DARK = 0.05

#: Noise is estimated in blocks of `_BLOCK` x `_BLOCK` texels, since dark corners have more of it. At least
#: the fraction `_EVEN` of a block is assumed free of edges. An edge exceeds the largest difference in that
#: fraction by the factor `_ABOVE_NOISE`; that difference is 0.67 standard deviations of normal noise.
_BLOCK, _EVEN, _ABOVE_NOISE = 16, 0.25, 4.0

#: Macros of kernels/postprocess/irradiance_edges.cl.
_OPTIONS = {
    "EDGE": f"{_EDGE}f",
    "EDGE_NEAR_BORDER": f"{_EDGE_NEAR_BORDER}f",
    "BLOCK": _BLOCK,
    "EVEN": f"{_EVEN}f",
    "ABOVE_NOISE": f"{_ABOVE_NOISE}f",
}

#: Bit flags of kernels/postprocess/irradiance_edges.cl.
ON_EDGE, AT_AN_END = 1, 2


@dataclass(frozen=True)
class PatchLight:
    """Solution of the patches, after the iteration has converged.

    light:     (n, 1) float32, E/pi, sum of the channels, contiguous
    validity:  (n,) float32, fraction of the hemisphere without back faces
    invalid:   (n,) bool, True for invalid patches; must not be changed, since its upload is cached
    """

    light: Values
    validity: np.ndarray
    invalid: np.ndarray


def find_edges(compute: ComputeDevice, entries: np.ndarray, known: PatchLight) -> np.ndarray:
    """Return the marks of texels, (atlases, r, r) uint8: `ON_EDGE`, `AT_AN_END`.

    An edge is a texel whose irradiance or validity differs from the mean of its neighbours along a row or
    column. It is also a texel next to the boundary between valid and invalid patches, and a patch between two
    edges. At chart borders a lower threshold applies, since a shadow may end between the last centre and the
    border. Each difference must exceed the local noise level. A chart end has no neighbour on either side
    along one axis, or no patch.

    compute:  OpenCL device
    entries:  (atlases, r, r) uint32, the patch + 1 of each texel, 0 for none; must not be changed later,
              since its upload is cached, as those of the marks and of `known.invalid`
    known:    solution of the patches
    """
    options = [f"-D{name}={value}" for name, value in _OPTIONS.items()]
    names = "find_edges", "noise_of_blocks", "mark_edges", "join_edges"
    find, measure, mark, join = compute.kernels("irradiance_edges.cl", *names, options=options)
    atlases, side, _ = entries.shape
    blocks = -(-side // _BLOCK)
    sizes = 4 * entries.size, 4 * atlases * blocks**2, *(words_of(entries.size),) * 2
    off, noise, marks, joined = (unfilled(compute, size) for size in sizes)

    # Compute differences from the neighbours' mean, the noise level of each block, differences above the
    # noise, and texels between.
    least = np.float32(_DARK * float(np.asarray(known.light).mean()))
    light, _ = rows_on_device(compute, known.light)
    validity = upload(compute, known.validity.astype(np.float32, copy=False))
    own, invalid = (upload_once(compute, array) for array in (entries, known.invalid))
    compute.run_texels(find, entries.shape, own, light, validity, invalid, least, off, marks)
    in_blocks = atlases, blocks, blocks
    compute.run_texels(measure, in_blocks, own, off, np.int32(side), noise)
    compute.run_texels(mark, entries.shape, off, noise, np.int32(blocks), marks)
    compute.run_texels(join, entries.shape, own, marks, joined)
    found = download_bytes(compute, joined, entries.size).reshape(entries.shape)
    compute.shared.of(found, "bits", lambda: joined)
    return found
