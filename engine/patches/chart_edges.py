"""Chart edges: triangle sides that no other triangle of the chart shares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..array_ops import map_blocks
from ..scene.triangles import Triangles

#: Minimum area on the lightmap, square texels; smaller triangles count as degenerate.
_NO_TEXELS = 1e-9

#: Odd random factors of a multilinear hash of world coordinates, lightmap UVs and atlas.
_FACTORS = np.random.default_rng(14).integers(1 << 62, 1 << 63, 6, np.uint64) * np.uint64(2) + np.uint64(1)


@dataclass(frozen=True)
class ChartEdges:
    """Edges of charts, each from a first to a second end.

    positions:  (e, 2, 3) float32, m, relative to `Triangles.origin`
    normals:    (e, 2, 3) float32, shading normals
    texels:     (e, 2, 2) float64, lightmap position, texels
    outward:    (e, 2) float64, unit vector on the lightmap, away from the edge's triangle
    atlas:      (e,) int32
    """

    positions: np.ndarray
    normals: np.ndarray
    texels: np.ndarray
    outward: np.ndarray
    atlas: np.ndarray

    def __len__(self) -> int:
        return len(self.atlas)

    def subset(self, chosen: np.ndarray) -> ChartEdges:
        """Return a subset of the edges, by a mask or by indices."""
        return ChartEdges(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))

    @property
    def length(self) -> np.ndarray:
        """Length in the world, (e,) float64, m."""
        return _length(self.positions[:, 1].astype(np.float64) - self.positions[:, 0])

    @property
    def texel_length(self) -> np.ndarray:
        """Length on the lightmap, (e,) float64, texels."""
        return _length(self.texels[:, 1] - self.texels[:, 0])


def chart_edges(triangles: Triangles, atlases: int, resolution: int) -> ChartEdges:
    """Return the chart edges of the first `atlases` lightmaps.

    Two triangles of one chart share both ends of an edge in the world and on the lightmap. Triangles without
    area on the lightmap have no edges.
    """
    shown = np.flatnonzero((triangles.atlas < atlases) & (_texels(triangles.uvs, resolution) > _NO_TEXELS))
    alone = np.flatnonzero(_alone(_side_keys(triangles, shown).ravel()))

    triangle, corner = shown[alone // 3], alone % 3
    ends = triangle[:, None], np.stack([corner, (corner + 1) % 3], axis=1)
    texels = triangles.uvs[ends].astype(np.float64) * resolution
    opposite = triangles.uvs[triangle, (corner + 2) % 3].astype(np.float64) * resolution
    edges = ChartEdges(
        triangles.positions[ends],
        np.take_along_axis(triangles.normals.take(triangle, axis=0), ends[1][..., None], axis=1),
        texels,
        _outward(texels, opposite),
        triangles.atlas[triangle],
    )
    return edges.subset((edges.length > 0) & (edges.texel_length > 0))


def end_keys(edges: ChartEdges) -> np.ndarray:
    """Return a hash of each edge, (e,) uint64, equal for edges with the same end points in the world."""
    keys: np.ndarray = _hashed(edges.positions, _FACTORS).sum(axis=1)
    return keys


def _outward(ends: np.ndarray, opposite: np.ndarray) -> np.ndarray:
    """Return unit normals, (e, 2), of edges, (e, 2, 2), that point away from the triangle's third corner."""
    along = ends[:, 1] - ends[:, 0]
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
    away = np.einsum("ed,ed->e", ends[:, 0] - opposite, normal)
    return normal * (np.sign(away) / np.maximum(_length(normal), 1e-20))[:, None]


def _texels(uvs: np.ndarray, resolution: int) -> np.ndarray:
    """Return twice the lightmap area of triangles with UVs (t, 3, 2), (t,) float32, square texels."""
    area = np.empty(len(uvs), np.float32)

    def measure(block: slice) -> None:
        corners = uvs[block]
        (u1, v1), (u2, v2) = ((corners[:, k] - corners[:, 0]).T * resolution for k in (1, 2))
        area[block] = np.abs(u1 * v2 - u2 * v1)

    map_blocks(len(uvs), 28, measure)
    return area


def _side_keys(triangles: Triangles, chosen: np.ndarray) -> np.ndarray:
    """Return a hash of each triangle side, (m, 3) uint64: the sum of the hashes of its ends."""
    keys = np.empty((len(chosen), 3), np.uint64)

    def find_keys(block: slice) -> None:
        corners = _corner_keys(triangles, chosen[block])
        np.add(corners, np.roll(corners, -1, axis=1), out=keys[block])

    map_blocks(len(chosen), 100, find_keys)
    return keys


def _corner_keys(triangles: Triangles, chosen: np.ndarray) -> np.ndarray:
    """Return a hash of each triangle corner, (m, 3) uint64, of world position, lightmap UV and atlas."""
    keys = _hashed(triangles.positions[chosen], _FACTORS) ^ _hashed(triangles.uvs[chosen], _FACTORS[3:])
    return keys + triangles.atlas[chosen].astype(np.uint64)[:, None] * _FACTORS[5]


def _hashed(values: np.ndarray, factors: np.ndarray) -> np.ndarray:
    """Return a hash of float32 values, (..., k): (...) uint64.

    Multilinear hash (Carter and Wegman 1979) with the finalizer of SplitMix64 (Steele, Lea and Flood 2014).
    """
    total = np.zeros(values.shape[:-1], np.uint64)
    for index in range(values.shape[-1]):
        # Adding zero maps minus zero to zero.
        bits = (values[..., index] + np.float32(0)).view(np.uint32)
        total += bits * factors[index]
    total = (total ^ (total >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    hashed: np.ndarray = total ^ (total >> np.uint64(31))
    return hashed


def _alone(keys: np.ndarray) -> np.ndarray:
    """Return a mask of the keys that occur once, (n,) bool; overwrites the keys, (n,) uint64, to save memory.

    Indices replace the low bits of the keys, so that one sort orders both. Keys that collide are dropped:
    about two of three million edges of closed charts.
    """
    bits = np.uint64(max(1, len(keys).bit_length()))

    def put_index(block: slice) -> None:
        keys[block] >>= bits
        keys[block] <<= bits
        keys[block] |= np.arange(block.start, block.stop, dtype=np.uint64)

    map_blocks(len(keys), 8, put_index)
    keys.sort()
    same, alone = np.zeros(len(keys) + 1, bool), np.zeros(len(keys), bool)

    def compare(block: slice) -> None:
        last = min(block.stop + 1, len(keys))
        high = keys[block.start : last] >> bits
        same[block.start + 1 : last] = high[1:] == high[:-1]

    map_blocks(len(keys), 8, compare)
    alone[keys[~(same[1:] | same[:-1])] & (np.uint64(1) << bits) - np.uint64(1)] = True
    return alone


def _length(vectors: np.ndarray) -> np.ndarray:
    length: np.ndarray = np.sqrt(np.einsum("...d,...d->...", vectors, vectors))
    return length
