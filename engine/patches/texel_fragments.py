"""Texel fragments: the parts of triangles inside texels, by conservative rasterization (OpenCL)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import NamedTuple

import numpy as np

from ..array_ops import joined_rows, map_blocks, order_of, take_rows
from ..device.buffers import download, lasting_buffer, upload, upload_once, zeros
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..scene.triangles import Triangles

#: Minimum area of a fragment, in texels; smaller ones result from rounding.
_LEAST_PIECE = 1e-6

_NAMES = ("border_texels", "piece_areas", "points_in_texels", "list_points")

#: Bytes for each point in the device arrays: triangle, texel, barycentrics, position, weight.
_OF_POINT = (4, 4, 12, 8, 4)


@dataclass(frozen=True)
class TexelFragments:
    """Fragments: the intersection of a texel and a triangle.

    atlas:     (m,) int32
    texel:     (m,) int32, row * resolution + column
    triangle:  (m,) int32
    area:      (m,) float32, in texels
    """

    atlas: np.ndarray
    texel: np.ndarray
    triangle: np.ndarray
    area: np.ndarray

    def __len__(self) -> int:
        return len(self.texel)

    def keys(self, resolution: int) -> np.ndarray:
        """Return atlas * r * r + texel of each fragment, (m,) int64."""
        keys: np.ndarray = self.atlas.astype(np.int64) * resolution**2 + self.texel
        return keys

    def subset(self, chosen: np.ndarray | slice) -> TexelFragments:
        """Return a subset of the fragments, by a mask, indices or a slice."""
        columns = self.atlas, self.texel, self.triangle, self.area
        return TexelFragments(*(take_rows(column, chosen) for column in columns))


class TexelPoints(NamedTuple):
    """Sample points in texels, in texel order; the arrays must not be changed, since their upload is cached.

    atlas:        (s,) int32
    texel:        (s,) int32, row * resolution + column
    triangle:     (s,) int32
    barycentric:  (s, 3) float32
    position:     (s, 2) float32, lightmap position, texels
    weight:       (s,) float32, texels
    """

    atlas: np.ndarray
    texel: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray
    position: np.ndarray
    weight: np.ndarray


def joined_pieces(several: list[TexelFragments]) -> TexelFragments:
    """Concatenate fragments; the list must not be empty."""
    names = TexelFragments.__dataclass_fields__
    return TexelFragments(*(joined_rows([getattr(pieces, name) for pieces in several]) for name in names))


class TexelClipper:
    """Clipper of lightmap triangles against texels, on the OpenCL device, with cached inputs."""

    def __init__(self, compute: ComputeDevice, triangles: Triangles, resolution: int) -> None:
        self.compute, self._triangles, self._resolution = compute, triangles, resolution
        self._kernels = dict(zip(_NAMES, compute.kernels("texel_fragments.cl", *_NAMES), strict=True))
        self._uvs = lasting_buffer(compute, triangles.uvs)
        self._listed: dict[int, tuple] = {}

    def rows(self, atlases: int) -> tuple:
        """Return the triangle and texel row pairs of the first atlases: their number and device buffers.

        Computed once for each number of atlases.
        """
        if atlases not in self._listed:
            self._listed[atlases] = self._list_rows(atlases)
        return self._listed[atlases]

    def border_pieces(self, wanted: np.ndarray) -> TexelFragments:
        """Return the fragments of wanted texels that triangles cover partly, sorted by texel.

        A full texel may appear too if one triangle fills it.

        wanted:  (atlases, r, r) bool or uint8; must not be changed, since its upload is cached
        """
        compute, (count, *buffers) = self.compute, self.rows(len(wanted))
        total, none = 0, np.zeros((3, 0), np.int32)
        if count:
            rows = (self._uvs, *buffers, upload_once(compute, wanted), np.int32(self._resolution))

            # First pass counts, second pass writes.
            starts = self._buffer(4 * count)
            self._run("border_texels", count, *rows, np.int32(0), starts, starts)
            number = self._read(starts, count, "i4")
            ends = np.cumsum(number, dtype=np.int32)
            total = int(ends[-1])
        if not total:
            return self._pieces(none[0], none[0], np.zeros(0, np.float32))
        found = self._buffer(12 * total)
        self._run("border_texels", count, *rows, np.int32(total), upload(compute, ends - number), found)
        triangle, texel, area = download(compute, found, (3, total)).view(np.int32)
        pieces = self._pieces(triangle, texel, area.view(np.float32))
        return pieces.subset(order_of(pieces.keys(self._resolution)))

    def pieces_at(self, triangle: np.ndarray, texel: np.ndarray) -> TexelFragments:
        """Return the fragments of triangles, (m,), in texels, (m,), of their atlases; drops empty ones."""
        count = len(texel)
        areas = zeros(self.compute, 4 * max(1, count))
        self._run("piece_areas", count, self._uvs, *self._where(triangle, texel), areas)
        return self._pieces(triangle, texel, self._read(areas, count, "f4"))

    def points_in_texels(self, pieces: TexelFragments, starts: np.ndarray, side: int) -> TexelPoints:
        """Place `side` x `side` sample points in each texel, on its fragments.

        pieces:  fragments sorted by texel
        starts:  (t,) int64, first fragment of each texel
        side:    sample points along each axis
        """
        each, texels = side**2, len(starts)
        where = [self._indices(pieces.triangle), self._indices(pieces.texel)]
        found = [self._buffer(size * texels) for size in (4 * each, 12 * each, 8 * each, 4)]
        ends, counts = self._indices(np.append(starts, len(pieces))), self._buffer(4 * texels)
        area = upload(self.compute, pieces.area) if texels else counts
        sides = np.int32(self._resolution), np.int32(side)
        self._run("points_in_texels", texels, self._uvs, *where, area, ends, *sides, *found, counts)

        # Register the device buffers as cached uploads, so that later passes do not upload the points again.
        last = np.cumsum(self._read(counts, texels, "i4"))
        firsts, total = self._indices(np.append(0, last[:-1])), int(last[-1]) if texels else 0
        listed = [self._buffer(size * total) for size in _OF_POINT]
        self._run("list_points", texels, *where, *found, firsts, np.int32(each), *listed)
        triangle, texel = (self._points(buffer, (total,), "i4") for buffer in listed[:2])
        shapes = (total, 3), (total, 2), (total,)
        others = (self._points(*pair, "f4") for pair in zip(listed[2:], shapes, strict=True))
        return TexelPoints(self._triangles.atlas[triangle], texel, triangle, *others)

    def _list_rows(self, atlases: int) -> tuple:
        """Upload the pairs of `_rows`; return their number, buffers, and the atlases of triangles."""
        triangle, row = self._rows(atlases)
        arrays = (triangle, row, self._triangles.atlas.astype(np.int32, copy=False))
        return len(triangle), *(upload(self.compute, array) for array in arrays if len(triangle))

    def _rows(self, atlases: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the texel rows that triangles touch in the first atlases: triangle and row, (m,) int32."""
        triangles, resolution = self._triangles, self._resolution
        chosen = np.flatnonzero(triangles.atlas < atlases).astype(np.int32)
        first, count = np.empty(len(chosen), np.int32), np.empty(len(chosen), np.int32)

        def find(block: slice) -> None:
            rows = triangles.uvs[chosen[block], :, 1].T
            low, high = (reduce(choose, rows) for choose in (np.minimum, np.maximum))
            first[block] = np.clip(np.floor(low * np.float64(resolution)), 0, resolution)
            count[block] = np.clip(np.ceil(high * np.float64(resolution)), first[block], resolution)

        map_blocks(len(chosen), 20, find)
        count -= first
        first -= np.cumsum(count, dtype=np.int32)
        first += count
        row = np.arange(count.sum(), dtype=np.int32)
        row += np.repeat(first, count)
        return np.repeat(chosen, count), row

    def _pieces(self, triangle: np.ndarray, texel: np.ndarray, area: np.ndarray) -> TexelFragments:
        """Drop fragments with negligible area."""
        pieces = TexelFragments(self._triangles.atlas[triangle], texel, triangle, area)
        return pieces.subset(area > _LEAST_PIECE)

    def _where(self, *arrays: np.ndarray) -> tuple:
        """Upload the texel arrays as int32; return their buffers and the resolution."""
        return (*map(self._indices, arrays), np.int32(self._resolution))

    def _indices(self, values: np.ndarray) -> cl.Buffer:
        """Upload an array as int32; an empty array becomes a small buffer."""
        return upload(self.compute, values.astype(np.int32)) if len(values) else zeros(self.compute, 8)

    def _read(self, buffer: cl.Buffer, count: int, kind: str) -> np.ndarray:
        return download(self.compute, buffer, (count,)).view(kind) if count else np.zeros(0, kind)

    def _points(self, buffer: cl.Buffer, shape: tuple[int, ...], kind: str) -> np.ndarray:
        """Download point data and register its buffer as the cached upload of the result."""
        values = self._read(buffer, int(np.prod(shape)), kind).reshape(shape)
        self.compute.shared.of(values, "bits", lambda: buffer)
        return values

    def _buffer(self, size: int) -> cl.Buffer:
        return cl.Buffer(self.compute.context, cl.mem_flags.READ_WRITE, max(4, size))

    def _run(self, name: str, count: int, *arguments: object) -> None:
        if count:
            self.compute.run(self._kernels[name], count, *arguments, np.int32(count))
