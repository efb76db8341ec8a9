"""Seam points for the fit, moved so that bilinear lookups there read no texel of an unrelated chart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..array_ops import nonzero_entries, slices_by_sum
from ..patches.chart_edges import ChartEdges, chart_edges
from ..patches.edge_boxes import EdgeNeighbours
from ..patches.edge_pairs import EdgePairs, edge_pairs
from ..patches.seams import Seams, seams_of
from ..scene.triangles import Triangles
from .bilinear import footprints

#: Distance in texels beyond a border point from which the border faces a lookup; excludes chart corners.
_FACES = 0.25

#: Pairs of lookup texels and border points that are compared at once (chosen), about 100 bytes each.
_PAIRS = 1 << 18

#: Minimum points for each texel of border length; the two ends are added.
_POINTS = 1.5


@dataclass(frozen=True)
class ChartBorders:
    """Points along the borders of charts.

    atlas:    (b,) int32
    texel:    (b, 2) float64, lightmap position, texels; the centre of the first texel is (0.5, 0.5)
    outward:  (b, 2) float64, unit vector on the lightmap, away from the chart
    """

    atlas: np.ndarray
    texel: np.ndarray
    outward: np.ndarray


def borders_without_seam(edges: ChartEdges, pairs: EdgePairs) -> ChartBorders:
    """Return points along the chart edges that belong to no pair, including their ends."""
    free = np.ones(len(edges), bool)
    free[pairs.first] = free[pairs.second] = False
    edges = edges.subset(free)
    steps = np.ceil(_POINTS * edges.texel_length).astype(np.int64)
    edge = np.repeat(np.arange(len(edges)), steps + 1)
    number = np.arange(len(edge)) - np.repeat(np.cumsum(steps + 1) - steps - 1, steps + 1)
    along = (number / steps[edge])[:, None]
    texel = (1 - along) * edges.texels[edge, 0] + along * edges.texels[edge, 1]
    return ChartBorders(edges.atlas[edge], texel, edges.outward[edge])


def display_seams(
    triangles: Triangles, atlases: int, resolution: int, neighbours: EdgeNeighbours | None = None
) -> Seams:
    """Return the seams of the first `atlases` lightmaps, whose lookups share no texels with other borders.

    If two charts are nearer than two texels, lookups at both borders read the same gutter texels. If the
    border of one has no seam, the seam of the other must not determine these texels; see `own_sides`.

    neighbours:  broad phase for edges that may coincide; None for the version on the host
    """
    edges = chart_edges(triangles, atlases, resolution)
    pairs = edge_pairs(edges, neighbours)
    seams = seams_of(edges, pairs)
    if not len(seams):
        return seams
    return own_sides(seams, borders_without_seam(edges, pairs), atlases, resolution)


def own_sides(seams: Seams, borders: ChartBorders, atlases: int, resolution: int) -> Seams:
    """Return seams of the first `atlases` lightmaps, moved so that no lookup reads texels of a facing border.

    A lookup that reads such texels moves to the nearest row, column or centre of texels where it reads none.
    A pair of points is dropped if there is no such place.
    """
    texel, kept = seams.texel.copy(), np.ones(len(seams), bool)
    sides = [footprints(seams.atlas[:, side], seams.texel[:, side], resolution) for side in (0, 1)]
    read = _BorderTexels(borders, (atlases, resolution), sides)
    for side, looked_up in enumerate(sides):
        foreign = read.facing(seams.texel[:, side], *looked_up)
        moved = np.flatnonzero(foreign.any(axis=1))
        texel[moved, side], found = _moved(seams.texel[moved, side], foreign[moved])
        kept[moved[~found]] = False
    return Seams(seams.atlas, texel, seams.weight).subset(kept)


class _BorderTexels:
    """Texels that lookups along chart borders read, sorted by flat index.

    borders:    points along borders without a seam
    shape:      number of lightmaps and their width
    looked_up:  lookups at seams, as `footprints` returns them; only their texels are stored
    """

    def __init__(
        self, borders: ChartBorders, shape: tuple[int, int], looked_up: list[tuple[np.ndarray, np.ndarray]]
    ) -> None:
        self._borders, (atlases, resolution) = borders, shape
        texels, weights = footprints(borders.atlas, borders.texel, resolution)
        wanted = np.zeros(atlases * resolution**2, bool)
        for others, _ in looked_up:
            wanted[others] = True
        point, corner = nonzero_entries(wanted[texels] & (weights > 0))
        read = texels[point, corner]
        order = np.argsort(read, kind="stable")
        self._texel, self._point = read[order], point[order]
        self._is_read = np.zeros(len(wanted), bool)
        self._is_read[read] = True

    def facing(self, position: np.ndarray, texels: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return the lookup texels that a border facing the lookup also reads, (p, 4) bool.

        position:         (p, 2), texels, position of each lookup
        texels, weights:  (p, 4), its texels and weights
        """
        foreign = np.zeros(texels.shape, bool)
        point, corner = nonzero_entries(self._is_read[texels] & (weights > 0))
        start, end = (np.searchsorted(self._texel, texels[point, corner], side) for side in ("left", "right"))

        # Pair each lookup texel with every border point that reads the same texel, some texels at a time.
        for some in slices_by_sum(end - start, _PAIRS):
            count = (end - start)[some]
            entry = np.repeat(np.arange(some.start, some.stop), count)
            order = np.arange(len(entry)) + np.repeat(start[some] - np.cumsum(count) + count, count)
            border = self._point[order]
            beyond = position[point[entry]] - self._borders.texel[border]
            faced = entry[np.einsum("kd,kd->k", beyond, self._borders.outward[border]) > _FACES]
            foreign[point[faced], corner[faced]] = True
        return foreign


def _moved(position: np.ndarray, foreign: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the nearest positions whose lookups read no foreign texel, and a mask of existing ones.

    foreign:  (q, 4) bool, lower left, lower right, upper left, upper right
    """
    low = np.floor(position - 0.5)
    fraction = position - 0.5 - low

    # Candidates on each axis: the position itself, the texel centres below it, the texel centres above it.
    places = np.stack([fraction, np.zeros_like(fraction), np.ones_like(fraction)], axis=1)
    places = np.stack([places[:, [0, 1, 2] * 3, 0], places[:, np.repeat([0, 1, 2], 3), 1]], axis=2)
    u, v = places[..., 0], places[..., 1]
    weights = np.stack([(1 - v) * (1 - u), (1 - v) * u, v * (1 - u), v * u], axis=2)
    distance = np.abs(places - fraction[:, None]).sum(axis=2)
    distance[((weights > 0) & foreign[:, None]).any(axis=2)] = np.inf
    best = np.arange(len(position)), distance.argmin(axis=1)
    return low + 0.5 + places[best], np.isfinite(distance[best])
