"""Texels on an edge of light, or of what is seen: they show more than what is at their centre."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.buffers import download, upload, zeros
from ..device.compute import Compute
from ..patches.texels_around import cells_around

#: Light has an edge where it differs from the mean of its neighbours by more than this part.
_EDGE = 0.1

#: At the border of a chart light may have an edge between the centre of a texel and its end, which no other
#: centre shows. Light around the texel that differs from the mean of its neighbours by this part tells of it.
_EDGE_NEAR_BORDER = 0.05

#: Light below this part of the map's mean counts as if it were that bright.
_DARK = 0.05

#: Edges stand out from noise: by this many times the median difference.
_ABOVE_NOISE = 6.0

#: The median difference is that of about this many patches, spread evenly.
_FOR_NOISE = 1 << 16

#: Marks of kernels/edges.cl.
_ON_EDGE, _AT_AN_END, _AT_A_BORDER = 1, 2, 4


@dataclass(frozen=True)
class PatchLight:
    """What is known of patches once the light has settled, (n, ...) each.

    light   (n,) float32, all light, sum of the channels
    front   (n,) float32, the fraction of the view that no back takes
    hidden  (n,) bool, nobody sees the patch
    """

    light: np.ndarray
    front: np.ndarray
    hidden: np.ndarray


def find_edges(compute: Compute, entries: np.ndarray, known: PatchLight) -> tuple[np.ndarray, np.ndarray]:
    """Return texels on an edge, and those at an end of their chart along an axis, two (atlases, r, r) bool.

    entries  (atlases, r, r) uint32, the patch + 1 of each texel; 0 for none, which is at an end

    An edge is where light or the backs in view are not the mean of the neighbours', and both sides of a
    border of what is hidden. Light around a texel at the border of its chart that is less even than elsewhere
    is one, too: a shadow may end on the way from the centre to the border.
    """
    (kernel,) = compute.kernels(("texel.cl", "edges.cl"), "find_edges")
    off, marks = zeros(compute, 4 * entries.size), zeros(compute, 4 * (entries.size // 4 + 1))
    values = (values.astype(np.float32, copy=False) for values in (known.light, known.front))
    least = np.float32(_DARK * float(known.light.mean()))
    buffers = [upload(compute, array) for array in (entries, *values, known.hidden.view(np.uint8))]
    compute.run_texels(kernel, entries.shape, *buffers, least, off, marks)
    found = download(compute, marks, (entries.size // 4 + 1,)).view(np.uint8)[: entries.size]
    found = found.reshape(entries.shape)
    steps, lit = download(compute, off, entries.shape), np.flatnonzero(entries)
    noise = float(np.median(steps.ravel()[lit[:: 1 + len(lit) // _FOR_NOISE]])) if len(lit) else 0.0
    noise *= _ABOVE_NOISE
    edge = (steps > max(_EDGE, noise)) | (found & _ON_EDGE > 0)
    border = np.flatnonzero(found & _AT_A_BORDER)
    beside = cells_around(steps, border).max(axis=1, initial=0) > max(_EDGE_NEAR_BORDER, noise)
    edge.ravel()[border[beside]] = True
    return edge, found & _AT_AN_END > 0
