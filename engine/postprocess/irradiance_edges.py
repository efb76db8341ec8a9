"""Texels on an edge of light, or of what is seen: they show more than what is at their centre."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.buffers import download_bytes, upload, upload_once, words_of, zeros
from ..device.cl_device import ComputeDevice
from ..device.device_array import Values, rows_on_device

#: Light has an edge where it differs from the mean of its neighbours by more than this part.
_EDGE = 0.1

#: At the border of a chart light may have an edge between the centre of a texel and its end, which no other
#: centre shows. Light around the texel that differs from the mean of its neighbours by this part tells of it.
_EDGE_NEAR_BORDER = 0.05

#: Light below this part of the map's mean counts as if it were that bright.
_DARK = 0.05

#: Edges stand out from noise, which is told in blocks of this many texels squared: dark corners have more of
#: it than what sees the sky. A part of a block at least has no edges; they stand out by this many times the
#: largest difference there, which for a quarter is 0.67 standard deviations of normal noise.
_BLOCK, _EVEN, _ABOVE_NOISE = 16, 0.25, 4.0

#: The same in kernels/postprocess/irradiance_edges.cl.
_OPTIONS = {
    "EDGE": f"{_EDGE}f",
    "EDGE_NEAR_BORDER": f"{_EDGE_NEAR_BORDER}f",
    "BLOCK": _BLOCK,
    "EVEN": f"{_EVEN}f",
    "ABOVE_NOISE": f"{_ABOVE_NOISE}f",
}

#: Marks of kernels/postprocess/irradiance_edges.cl.
_ON_EDGE, _AT_AN_END = 1, 2


@dataclass(frozen=True)
class PatchLight:
    """What is known of patches once the light has settled, (n, ...) each.

    light   (n, 1) float32, all light, sum of the channels; rows one after the other
    front   (n,) float32, the fraction of the view that no back takes
    hidden  (n,) bool, nobody sees the patch
    """

    light: Values
    front: np.ndarray
    hidden: np.ndarray


def find_edges(
    compute: ComputeDevice, entries: np.ndarray, known: PatchLight
) -> tuple[np.ndarray, np.ndarray]:
    """Return texels on an edge, and those at an end of their chart along an axis, two (atlases, r, r) bool.

    entries  (atlases, r, r) uint32, the patch + 1 of each texel; 0 for none, which is at an end; nobody
             changes it

    An edge is where light or the backs in view are not the mean of the neighbours', and both sides of a
    border of what is hidden. Light around a texel at the border of its chart that is less even than elsewhere
    is one, too: a shadow may end on the way from the centre to the border. Both have to stand out from the
    noise nearby, so that bakes of few rays do not take noise for edges.
    """
    options = [f"-D{name}={value}" for name, value in _OPTIONS.items()]
    names = "find_edges", "noise_of_blocks", "mark_edges"
    find, tell_noise, mark = compute.kernels("irradiance_edges.cl", *names, options=options)
    atlases, side, _ = entries.shape
    blocks = -(-side // _BLOCK)
    sizes = 4 * entries.size, 4 * atlases * blocks**2, words_of(entries.size)
    off, noise, marks = (zeros(compute, size) for size in sizes)

    # How far light is off the mean of its neighbours, how much of that is noise, and what is more.
    least = np.float32(_DARK * float(np.asarray(known.light).mean()))
    light, _ = rows_on_device(compute, known.light)
    arrays = known.front.astype(np.float32, copy=False), known.hidden.view(np.uint8)
    buffers = upload_once(compute, entries), light, *(upload(compute, array) for array in arrays)
    compute.run_texels(find, entries.shape, *buffers, least, off, marks)
    in_blocks = atlases, blocks, blocks
    compute.run_texels(tell_noise, in_blocks, buffers[0], off, np.int32(side), noise)
    compute.run_texels(mark, entries.shape, off, noise, np.int32(blocks), marks)
    found = download_bytes(compute, marks, entries.size).reshape(entries.shape)
    return found & _ON_EDGE > 0, found & _AT_AN_END > 0
