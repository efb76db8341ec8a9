"""The edges at which charts end: sides of triangles that no other triangle continues on the lightmap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..scene.triangles import Triangles

#: A triangle of fewer square texels has no area on the lightmap.
_NO_TEXELS = 1e-9

#: Odd factors of a multilinear hash over the world's and the lightmap's coordinates, and over the atlas.
_FACTORS = np.random.default_rng(14).integers(1 << 62, 1 << 63, 6, np.uint64) * np.uint64(2) + np.uint64(1)


@dataclass(frozen=True)
class ChartEdges:
    """Edges of charts, each from its first to its second end.

    positions  (e, 2, 3) float32, metres from `Triangles.origin`
    normals    (e, 2, 3) float32, shading normals
    texels     (e, 2, 2) float64, lightmap position in texels
    outward    (e, 2) float64, unit vector on the lightmap, away from the edge's triangle
    atlas      (e,) int32
    """

    positions: np.ndarray
    normals: np.ndarray
    texels: np.ndarray
    outward: np.ndarray
    atlas: np.ndarray

    def __len__(self) -> int:
        return len(self.atlas)

    def part(self, chosen: np.ndarray) -> ChartEdges:
        """Return some edges, by a mask or their numbers."""
        return ChartEdges(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))

    @property
    def length(self) -> np.ndarray:
        """Length in the world, (e,) float64, metres."""
        return _length(self.positions[:, 1].astype(np.float64) - self.positions[:, 0])

    @property
    def texel_length(self) -> np.ndarray:
        """Length on the lightmap, (e,) float64, texels."""
        return _length(self.texels[:, 1] - self.texels[:, 0])


def chart_edges(triangles: Triangles, atlases: int, resolution: int) -> ChartEdges:
    """Return the edges at which the charts of the first `atlases` lightmaps end.

    Two triangles of one chart share an edge's end points in the world and on the lightmap. Triangles
    without an area on the lightmap have no edges.
    """
    shown = np.flatnonzero((triangles.atlas < atlases) & (_texels(triangles.uvs, resolution) > _NO_TEXELS))
    corners = _corner_keys(triangles, shown)
    alone = np.flatnonzero(_alone((corners + np.roll(corners, -1, axis=1)).ravel()))

    triangle, corner = shown[alone // 3], alone % 3
    ends = triangle[:, None], np.stack([corner, (corner + 1) % 3], axis=1)
    texels = triangles.uvs[ends].astype(np.float64) * resolution
    opposite = triangles.uvs[triangle, (corner + 2) % 3].astype(np.float64) * resolution
    edges = ChartEdges(
        triangles.positions[ends],
        triangles.normals[ends],
        texels,
        _outward(texels, opposite),
        triangles.atlas[triangle],
    )
    return edges.part((edges.length > 0) & (edges.texel_length > 0))


def end_keys(edges: ChartEdges) -> np.ndarray:
    """Return a key of every edge, (e,) uint64, that edges with the same end points in the world share."""
    keys: np.ndarray = _hashed(edges.positions, _FACTORS).sum(axis=1)
    return keys


def _outward(ends: np.ndarray, opposite: np.ndarray) -> np.ndarray:
    """Return the unit normals of edges, (e, 2, 2), away from the third corners of their triangles, (e, 2)."""
    along = ends[:, 1] - ends[:, 0]
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
    away = np.einsum("ed,ed->e", ends[:, 0] - opposite, normal)
    return normal * (np.sign(away) / np.maximum(_length(normal), 1e-20))[:, None]


def _texels(uvs: np.ndarray, resolution: int) -> np.ndarray:
    """Return twice the area of triangles, uvs (t, 3, 2), on the lightmap, (t,) float32, texels."""
    (u1, v1), (u2, v2) = ((uvs[:, k] - uvs[:, 0]).T * resolution for k in (1, 2))
    area: np.ndarray = np.abs(u1 * v2 - u2 * v1)
    return area


def _corner_keys(triangles: Triangles, chosen: np.ndarray) -> np.ndarray:
    """Return keys of the corners of some triangles, (m, 3) uint64: of place in world and lightmap."""
    keys = _hashed(triangles.positions[chosen], _FACTORS) ^ _hashed(triangles.uvs[chosen], _FACTORS[3:])
    return keys + triangles.atlas[chosen].astype(np.uint64)[:, None] * _FACTORS[5]


def _hashed(values: np.ndarray, factors: np.ndarray) -> np.ndarray:
    """Return a multilinear hash of float32 values, (..., k), with the finalizer of SplitMix64, (...) uint64.

    Carter and Wegman 1979; Steele, Lea and Flood 2014.
    """
    total = np.zeros(values.shape[:-1], np.uint64)
    for index in range(values.shape[-1]):
        # Minus zero and zero are one place.
        bits = (values[..., index] + np.float32(0)).view(np.uint32)
        total += bits * factors[index]
    total = (total ^ (total >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    hashed: np.ndarray = total ^ (total >> np.uint64(31))
    return hashed


def _alone(keys: np.ndarray) -> np.ndarray:
    """Return which keys occur once, (n,) bool.

    Numbers take the low bits of the keys, so that one sort orders both: of three million edges of closed
    charts, it is likely that two are taken for one another and dropped.
    """
    bits = np.uint64(max(1, len(keys).bit_length()))
    ordered = np.sort(keys >> bits << bits | np.arange(len(keys), dtype=np.uint64))
    same = np.zeros(len(keys) + 1, bool)
    same[1:-1] = ordered[1:] >> bits == ordered[:-1] >> bits
    alone = np.zeros(len(keys), bool)
    alone[ordered[~(same[1:] | same[:-1])] & (np.uint64(1) << bits) - np.uint64(1)] = True
    return alone


def _length(vectors: np.ndarray) -> np.ndarray:
    length: np.ndarray = np.sqrt(np.einsum("...d,...d->...", vectors, vectors))
    return length
