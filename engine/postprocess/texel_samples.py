"""Points at which a lightmap has to show the light: several in a texel that shows more than one thing."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..numpy_pickle import NumpyPickle
from ..patches.patch_scene import PatchScene
from ..patches.texel_fragments import TexelClipper, TexelFragments, joined_pieces
from ..row_ops import joined_rows, row_products, take_rows
from ..scene.triangles import Triangles
from ..segment_sums import segment_sums
from ..sorted_runs import run_numbers, run_starts
from .irradiance_edges import PatchLight, find_edges

#: A texel is wholly covered from this part on; faces of a texel lie in one plane if the cosine between their
#: normals is larger.
_WHOLE, _FLAT = 0.999, 0.98

#: Points of all texels together: the host keeps about 64 bytes of each, and some time goes into them.
_MOST_POINTS = 1 << 22

#: Least points of a texel that has several.
_FEWEST = 4

#: Coverage below which a texel whose centre nobody covers shows nothing of its own.
_SLIVER = 0.01


@dataclass(frozen=True)
class TexelSamples(NumpyPickle):
    """Points on surfaces, ordered by atlas and texel.

    atlas        (s,) int32
    texel        (s,) int32, row * resolution + column: the texel that shows the point
    position     (s, 2) float32, on the lightmap, texels: the centre of texel (x, y) is at x + 1/2, y + 1/2
    weight       (s,) float32, the part of its texel that the sample stands for
    triangle     (s,) int32
    barycentric  (s, 3) float32
    """

    atlas: np.ndarray
    texel: np.ndarray
    position: np.ndarray
    weight: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray

    def __len__(self) -> int:
        return len(self.texel)

    def keys(self, resolution: int) -> np.ndarray:
        """Return atlas * r * r + texel of each sample, (s,) int64."""
        keys: np.ndarray = self.atlas.astype(np.int64) * resolution**2 + self.texel
        return keys

    def part(self, chosen: slice | np.ndarray) -> TexelSamples:
        """Return some samples."""
        return TexelSamples(*(take_rows(getattr(self, name), chosen) for name in self.__dataclass_fields__))


def no_samples() -> TexelSamples:
    """Return no samples."""
    none = np.zeros(0, np.int32)
    weight, position = np.zeros(0, np.float32), np.zeros((0, 2), np.float32)
    return TexelSamples(none, none, position, weight, none, np.zeros((0, 3), np.float32))


def joined_samples(several: list[TexelSamples]) -> TexelSamples:
    """Return samples, then others; there are some at least."""
    names = TexelSamples.__dataclass_fields__
    return TexelSamples(*(joined_rows([getattr(samples, name) for samples in several]) for name in names))


def display_samples(
    clipper: TexelClipper, parts: PatchScene, atlases: int, known: PatchLight, points: int
) -> tuple[TexelSamples, int]:
    """Return so many `points` in each texel of the first atlases that shows more than its centre.

    These are texels that are partly covered, show several faces, or lie on an edge of light or of what is
    hidden. Where they would have too many points together each has fewer, at last every second or third texel
    alone. The number tells how many each has. The clipper is of the triangles.
    """
    resolution = parts.patches.resolution
    own = parts.patches.on_texels(atlases)
    edge, at_an_end = find_edges(clipper.compute, own, known)
    edge |= _between(edge) & (own > 0)

    # Of texels between others of their chart it shows in the light whether they need points.
    border = clipper.border_pieces(edge | at_an_end)
    key = border.keys(resolution)
    several = at_an_end & _shows_several(parts, border, key, own)
    chosen, points = _affordable((several | edge).ravel(), points)

    # Texels that one triangle fills are pieces, too.
    filled = chosen.copy()
    filled[key] = False
    entry = own.ravel()[np.flatnonzero(filled)]
    patch = entry[entry > 0].astype(np.int64) - 1
    whole = clipper.pieces_at(parts.patches.triangle[patch], parts.patches.texel[patch])
    pieces = joined_pieces([border.part(chosen[key]), whole])
    return _samples_of(clipper, pieces, resolution, points), points


def _between(edge: np.ndarray) -> np.ndarray:
    """Return the texels, (atlases, r, r) bool, between two on an edge of light.

    Half a shadow is the mean of light and shadow, and is on no edge for itself.
    """
    between = np.zeros_like(edge)
    between[:, 1:-1] |= edge[:, :-2] & edge[:, 2:]
    between[:, :, 1:-1] |= edge[:, :, :-2] & edge[:, :, 2:]
    return between


def _affordable(chosen: np.ndarray, points: int) -> tuple[np.ndarray, int]:
    """Return the texels, (t,) bool, that have several points, and how many points each has."""
    texels = np.flatnonzero(chosen)
    while points > _FEWEST and points * len(texels) > _MOST_POINTS:
        points //= 4
    kept = np.zeros_like(chosen)
    kept[texels[:: max(1, -(-points * len(texels) // _MOST_POINTS))]] = True
    return kept, points


def _shows_several(parts: PatchScene, border: TexelFragments, key: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Return the texels, (atlases, r, r) bool, that are partly covered, or by faces of several planes.

    key: of the pieces, see `TexelFragments.keys`; ascending
    """
    triangle, starts = border.triangle, run_starts(key)
    texel = key[starts]
    covered = segment_sums(border.area, run_numbers(starts, len(key)), len(starts))

    # Faces beside the first one of their texel.
    first = np.repeat(triangle[starts], np.diff(starts, append=len(key)))
    others = np.flatnonzero(triangle != first)
    normals = parts.geometry.steps.geometric
    bent = row_products(take_rows(normals, triangle[others]), take_rows(normals, first[others])) < _FLAT
    partly = (covered > 0) & (covered < _WHOLE)
    partly[np.searchsorted(starts, others[bent], "right") - 1] = True

    # Of texels whose centre nobody covers, slivers are left to those beside them.
    partly &= (own.ravel()[texel] > 0) | (covered > _SLIVER)
    several = np.zeros(own.size, bool)
    several[texel[partly]] = True
    return several.reshape(own.shape)


def _samples_of(clipper: TexelClipper, pieces: TexelFragments, resolution: int, points: int) -> TexelSamples:
    """Return the samples of texels whose pieces are given, `points` of each, a square number.

    Texels that are mostly covered have the points of a grid that lie on a triangle: light that is averaged
    around each is averaged over the texel. Others have all of their points within what is covered.
    """
    keys = pieces.keys(resolution)

    # Those of border texels and of others, both in their order: a stable sort merges them.
    order = np.argsort(keys, kind="stable")
    pieces, starts = pieces.part(order), run_starts(keys[order])
    found = clipper.points_in_texels(pieces, starts, math.isqrt(points))
    return TexelSamples(
        found.atlas, found.texel, found.position, found.weight, found.triangle, found.barycentric
    )


def on_lightmap(
    triangles: Triangles, triangle: np.ndarray, barycentric: np.ndarray, resolution: int
) -> np.ndarray:
    """Return where points of triangles are on their lightmap, (s, 2) float32, texels."""
    uvs = np.einsum("sk,skd->sd", barycentric, triangles.uvs[triangle])
    return (uvs * resolution).astype(np.float32)
