"""OpenCL version of `display_equations`, the least-squares equations of the texel values."""

from __future__ import annotations

import numpy as np

from ..device.buffers import download, download_bytes, upload, upload_once, words_of, zeros
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..patches.seams import Seams
from .lightmap_points import LightmapPoints

#: Kernel files of the equations and of their solution, built as one program: faster than two builds.
SOURCE = ("bilinear_equations.cl", "bilinear_fit.cl")

_NAMES = (
    "mark_points", "mark_seams", "unknown_texels", "number_texels", "find_points", "link_texels",
    "smooth_links", "seam_rows", "list_entries", "order_entries",
)  # fmt: skip

#: Entries in a row of the stencil (a texel and its eight neighbours), and texels that both lookups of a seam
#: read.
_LINKS, _CORNERS = 9, 8


class DeviceBilinearEquations:
    """Least-squares equations of texels that off-centre samples or seams read, in device buffers.

    resolution:  width and height of the lightmaps, texels
    size:        number of texels of all lightmaps
    centres:     (atlases, r, r) bool, texels with a light sample at their centre; must not be changed, since
                 its upload is cached
    off_centre:  off-centre samples, ordered by the texel in which they lie
    texel:       (n,) uint32, flat index of each unknown, on the host

    Device buffers:

    texels:               uint for each unknown, flat index
    centre:               uchar for each texel, `centres`
    owners:               uint for each off-centre sample, flat index of its texel
    ranges:               int2 for each unknown, first and last sample inside it
    neighbours, factors:  9 planes of int, float for each unknown; kernels/postprocess/bilinear_equations.cl
    linked:               uint for each unknown, flags of its links
    columns, entries:     int8 and float8 for each seam, the unknowns that it reads and their factors
    starts:               int for each unknown plus one, offsets into `read_by` and `shares`
    read_by, shares:      int and float for each entry, a seam that reads the unknown, and its factor
    inverse:              float for each unknown, inverse of the diagonal
    """

    def __init__(
        self, compute: ComputeDevice, centres: np.ndarray, off_centre: LightmapPoints, seams: Seams
    ) -> None:
        self._compute, self.resolution, self.size = compute, centres.shape[1], centres.size
        self._kernels = dict(zip(_NAMES, compute.kernels(SOURCE, *_NAMES), strict=True))
        self.points, self.seams = len(off_centre), len(seams)
        self.centre = upload_once(compute, centres)
        self.positions = self._uploaded(off_centre.position, np.float32)
        self.weights = self._uploaded(off_centre.weight, np.float32)
        self.owners = self._uploaded(off_centre.texels(self.resolution), np.uint32)
        self._sides = self._uploaded(seams.texel, np.float32)
        self._atlases = self._uploaded(seams.atlas, np.int32)
        self._lengths = self._uploaded(seams.weight, np.float32)
        marks = self._marked(centres.size)

        self.texel = self._unknown(marks, centres.size)
        self.count, self.texels = len(self.texel), self._uploaded(self.texel, np.uint32)
        if self.count:
            self._number(centres.size)
            self._link(marks)
            self._join_seams()

    def _uploaded(self, values: np.ndarray, dtype: type[np.generic]) -> cl.Buffer:
        """Upload an array; an empty one gets a dummy buffer, because OpenCL forbids size 0."""
        return upload(self._compute, values.astype(dtype, copy=False) if len(values) else np.zeros(8, dtype))

    def _read(self, buffer: cl.Buffer, count: int) -> np.ndarray:
        return download(self._compute, buffer, (count,)).view(np.uint32)

    def _run(self, name: str, count: int, *arguments: object) -> None:
        if count:
            self._compute.run(self._kernels[name], count, *arguments, np.int32(count))

    def _marked(self, size: int) -> cl.Buffer:
        """Return flags of all texels: True if off-centre samples or seams read the texel."""
        marks, self._counts = zeros(self._compute, 4 * size), zeros(self._compute, words_of(self.seams))
        resolution = np.int32(self.resolution)
        self._run("mark_points", self.points, self.positions, self.owners, marks, resolution)
        self._run(
            "mark_seams", self.seams, self._sides, self._atlases, self.centre, marks, self._counts, resolution
        )
        return marks

    def _unknown(self, marks: cl.Buffer, size: int) -> np.ndarray:
        """Return the flat indices of unknown texels, (n,) uint32."""
        unknown = zeros(self._compute, words_of(size))
        self._run("unknown_texels", size, marks, unknown)
        return np.flatnonzero(download_bytes(self._compute, unknown, size).view(bool)).astype(np.uint32)

    def _number(self, size: int) -> None:
        """Number the unknowns and find the range of samples inside each."""
        self._numbers = cl.Buffer(self._compute.context, cl.mem_flags.READ_WRITE, 4 * size)
        self.ranges = zeros(self._compute, 8 * self.count)
        self._run("number_texels", self.count, self.texels, self._numbers)
        self._run("find_points", self.points, self.owners, self._numbers, self.ranges)

    def _link(self, marks: cl.Buffer) -> None:
        """Compute the neighbours' factors for each unknown, from sample and smoothness equations."""
        planes = 4 * _LINKS * self.count
        self.neighbours, self.factors = (zeros(self._compute, planes) for _ in range(2))
        self.linked, diagonal = (zeros(self._compute, 4 * self.count) for _ in range(2))
        resolution = np.int32(self.resolution)
        self._run(
            "link_texels", self.count, self.texels, self._numbers, marks, self.centre, self.ranges,
            self.positions, self.weights, self.neighbours, self.factors, self.linked, diagonal, resolution,
        )  # fmt: skip
        self._run(
            "smooth_links", self.count, self.texels, marks, self.neighbours, diagonal, self.factors,
            self.linked, resolution,
        )  # fmt: skip

    def _join_seams(self) -> None:
        """Build the seam rows and list for each unknown the rows that read it."""
        compute = self._compute
        self.columns, self.entries = (zeros(compute, 4 * _CORNERS * max(1, self.seams)) for _ in range(2))
        uses = zeros(compute, 4 * self.count)
        self._run(
            "seam_rows", self.seams, self._sides, self._atlases, self._lengths, self._counts, self._numbers,
            self.columns, self.entries, uses, np.int32(self.resolution),
        )  # fmt: skip
        starts = np.zeros(self.count + 1, np.int32)
        np.cumsum(self._read(uses, self.count), out=starts[1:])
        self.starts, following = upload(compute, starts), upload(compute, starts)
        self.read_by, self.shares = (zeros(compute, 4 * max(1, int(starts[-1]))) for _ in range(2))
        self._run("list_entries", _CORNERS * self.seams, self.columns, self.entries, following, self.read_by)
        self.inverse = zeros(compute, 4 * self.count)
        self._run(
            "order_entries", self.count, self.starts, self.entries, self.factors, self.read_by, self.shares,
            self.inverse,
        )  # fmt: skip
