"""Supersampling of texels: several sample points in texels whose light is not uniform."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..array_ops import joined_rows, row_products, run_numbers, run_starts, segment_sums, take_rows
from ..numpy_pickle import NumpyPickle
from ..patches.patch_scene import PatchScene
from ..patches.texel_fragments import TexelClipper, TexelFragments, joined_pieces
from ..scene.triangles import Triangles
from .irradiance_edges import AT_AN_END, ON_EDGE, PatchLight, find_edges

#: Coverage from which a texel counts as full, and minimum cosine between normals of faces in one plane.
_WHOLE, _FLAT = 0.999, 0.98

#: Maximum number of points of all texels together; the host stores about 64 bytes for each.
_MOST_POINTS = 1 << 22

#: Minimum number of points of a supersampled texel.
_FEWEST = 4

#: Coverage below which a texel without a patch at its centre gets no samples.
_SLIVER = 0.01


@dataclass(frozen=True)
class TexelSamples(NumpyPickle):
    """Sample points on surfaces, sorted by atlas and texel.

    atlas:        (s,) int32
    texel:        (s,) int32, row * resolution + column of the texel that the sample belongs to
    position:     (s, 2) float32, texels, on the lightmap; the centre of texel (x, y) is at (x + 1/2, y + 1/2)
    weight:       (s,) float32, fraction of the texel that the sample represents
    triangle:     (s,) int32
    barycentric:  (s, 3) float32
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

    @cached_property
    def starts(self) -> np.ndarray:
        """First sample of each texel, (t,) int64."""
        changes = self.texel[1:] != self.texel[:-1]
        changes |= self.atlas[1:] != self.atlas[:-1]
        return np.flatnonzero(np.append(True, changes)[: len(self)])

    def texels(self, resolution: int) -> np.ndarray:
        """Return atlas * r * r + texel of each texel, (t,) int64."""
        texels: np.ndarray = self.atlas[self.starts].astype(np.int64) * resolution**2
        texels += self.texel[self.starts]
        return texels

    def subset(self, chosen: slice | np.ndarray) -> TexelSamples:
        """Return the samples that a slice or a mask selects."""
        return TexelSamples(*(take_rows(getattr(self, name), chosen) for name in self.__dataclass_fields__))


def no_samples() -> TexelSamples:
    """Return an empty set of samples."""
    none = np.zeros(0, np.int32)
    weight, position = np.zeros(0, np.float32), np.zeros((0, 2), np.float32)
    return TexelSamples(none, none, position, weight, none, np.zeros((0, 3), np.float32))


def joined_samples(parts: list[TexelSamples]) -> TexelSamples:
    """Concatenate samples; the list must not be empty."""
    names = TexelSamples.__dataclass_fields__
    return TexelSamples(*(joined_rows([getattr(samples, name) for samples in parts]) for name in names))


def display_samples(
    clipper: TexelClipper, patch_scene: PatchScene, atlases: int, known: PatchLight, points: int
) -> tuple[TexelSamples, int]:
    """Return `points` samples in each texel that is not uniform, and the number of points used.

    These texels are partly covered, contain several faces, or lie on an edge of irradiance or validity. If
    all points together exceed the limit, each texel gets fewer, and finally only every second or third texel
    gets any.

    clipper:      clips the triangles of `patch_scene` to texels
    patch_scene:  patches of the scene
    atlases:      number of the user's lightmaps
    known:        solution of the patches
    points:       points for each texel, a square number
    """
    resolution = patch_scene.patches.resolution
    own = patch_scene.patches.on_texels(atlases)
    marks = find_edges(clipper.compute, own, known)

    # Texels at chart borders are supersampled anyway. Texels inside a chart are added only if they lie on an
    # edge of light.
    border = clipper.border_pieces(marks)
    key, flat = border.keys(resolution), marks.ravel()
    several = _show_several(patch_scene, border, key, own)
    chosen = flat & ON_EDGE
    chosen[several[flat[several] & AT_AN_END > 0]] = ON_EDGE
    texels, points = _affordable(chosen, points)

    # Texels inside one triangle need fragments too.
    partly = chosen[key] > 0
    chosen[key] = 0
    entry = own.ravel()[texels[chosen[texels] > 0]]
    patch = entry[entry > 0].astype(np.int64) - 1
    whole = clipper.pieces_at(patch_scene.patches.triangle[patch], patch_scene.patches.texel[patch])
    pieces = joined_pieces([border.subset(partly), whole])
    return _samples_of(clipper, pieces, resolution, points), points


def _affordable(chosen: np.ndarray, points: int) -> tuple[np.ndarray, int]:
    """Return the chosen texels, (k,) int64, that fit the limit of points, and the number of points of each.

    chosen:  (t,) uint8, nonzero for chosen texels; set to 0 for those that do not fit
    """
    texels = np.flatnonzero(chosen.view(bool))
    while points > _FEWEST and points * len(texels) > _MOST_POINTS:
        points //= 4
    step = max(1, -(-points * len(texels) // _MOST_POINTS))
    if step > 1:
        chosen[texels] = 0
        texels = texels[::step]
        chosen[texels] = 1
    return texels, points


def _show_several(
    patch_scene: PatchScene, border: TexelFragments, key: np.ndarray, own: np.ndarray
) -> np.ndarray:
    """Return the texels, (k,) int64, that are partly covered or contain faces of several planes.

    patch_scene:  patches of the scene
    border:       fragments of triangles in border texels
    key:          texel of each fragment, see `TexelFragments.keys`, ascending
    own:          (atlases, r, r) uint32, the patch + 1 of each texel
    """
    triangle, starts = border.triangle, run_starts(key)
    texel = key[starts]
    covered = segment_sums(border.area, run_numbers(starts, len(key)), len(starts))

    # Compare each fragment's face with the first one of the same texel.
    first = np.repeat(triangle[starts], np.diff(starts, append=len(key)))
    others = np.flatnonzero(triangle != first)
    normals = patch_scene.geometry.steps.geometric
    bent = row_products(take_rows(normals, triangle[others]), take_rows(normals, first[others])) < _FLAT
    partly = (covered > 0) & (covered < _WHOLE)
    partly[np.searchsorted(starts, others[bent], "right") - 1] = True

    # A sliver in a texel whose centre is not covered is left to the neighbouring texel.
    partly &= (own.ravel()[texel] > 0) | (covered > _SLIVER)
    several: np.ndarray = texel[partly]
    return several


def _samples_of(clipper: TexelClipper, pieces: TexelFragments, resolution: int, points: int) -> TexelSamples:
    """Return `points` samples, a square number, in each texel with the given fragments.

    A texel that is mostly covered uses the points of a regular grid that lie on a triangle, so that the mean
    covers the texel evenly. Other texels place all points inside the covered part.
    """
    keys = pieces.keys(resolution)

    # A stable sort merges fragments of border texels and of full texels, both already sorted.
    order = np.argsort(keys, kind="stable")
    pieces, starts = pieces.subset(order), run_starts(keys[order])
    found = clipper.points_in_texels(pieces, starts, math.isqrt(points))
    return TexelSamples(
        found.atlas, found.texel, found.position, found.weight, found.triangle, found.barycentric
    )


def on_lightmap(
    triangles: Triangles, triangle: np.ndarray, barycentric: np.ndarray, resolution: int
) -> np.ndarray:
    """Return the lightmap position of points on triangles, (s, 2) float32, texels."""
    uvs = np.einsum("sk,skd->sd", barycentric, triangles.uvs[triangle])
    return (uvs * resolution).astype(np.float32)
