"""Points at which a lightmap has to show the light: several in a texel that shows more than one thing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..patches.subdivision import Subdivision
from ..patches.texel_pieces import TexelPieces, border_pieces, joined_pieces, pieces_at
from ..scene.triangles import Triangles
from .dilation import grown
from .texel_points import place_points

#: A texel is wholly covered from this part on; faces of a texel lie in one plane if the cosine between their
#: normals is larger.
_WHOLE, _FLAT = 0.999, 0.98

#: Light has an edge where it differs from the mean of its neighbours by more than this part, and where the
#: fraction of backs in view differs by more than this.
_EDGE, _EDGE_OF_BACKS = 0.1, 0.1

#: Light below this part of the map's mean counts as if it were that bright.
_DARK = 0.05

#: Edges stand out from noise: by this many times the median difference.
_ABOVE_NOISE = 6.0

#: Points of all texels together: the host keeps about 64 bytes of each, and some time goes into them.
_MOST_POINTS = 1 << 22

#: Least points of a texel that has several.
_FEWEST = 4

#: Coverage below which a texel whose centre nobody covers shows nothing of its own.
_SLIVER = 0.01


@dataclass(frozen=True)
class DisplaySamples:
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

    def part(self, chosen: slice) -> DisplaySamples:
        """Return some samples."""
        return DisplaySamples(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))


def no_samples() -> DisplaySamples:
    """Return no samples."""
    none = np.zeros(0, np.int32)
    weight, position = np.zeros(0, np.float32), np.zeros((0, 2), np.float32)
    return DisplaySamples(none, none, position, weight, none, np.zeros((0, 3), np.float32))


def joined_samples(several: list[DisplaySamples]) -> DisplaySamples:
    """Return samples, then others; there are some at least."""
    names = DisplaySamples.__dataclass_fields__
    return DisplaySamples(
        *(np.concatenate([getattr(samples, name) for samples in several]) for name in names)
    )


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


def display_samples(
    parts: Subdivision, atlases: int, known: PatchLight, points: int
) -> tuple[DisplaySamples, int]:
    """Return so many `points` in each texel of the first atlases that shows more than its centre.

    These are texels that are partly covered, show several faces, or lie on an edge of light or of what is
    hidden. Where they would have too many points together each has fewer, at last every second or third texel
    alone. The number tells how many each has.
    """
    triangles, resolution = parts.triangles, parts.patches.resolution
    shape = (atlases, resolution, resolution)
    own = _patches_of(parts, shape)
    edge = _on_edge(own, known)

    # Of texels between others of their chart it shows in the light whether they need points.
    unknown = (own < 0) | _at_an_end(own >= 0)
    border = border_pieces(triangles, edge | unknown)
    several = unknown & _shows_several(parts, border, own)
    chosen, points = _affordable((several | edge).ravel(), points)

    # Texels that one triangle fills are pieces, too.
    key = border.atlas.astype(np.int64) * resolution**2 + border.texel
    filled = chosen.copy()
    filled[key] = False
    patch = own.ravel()[np.flatnonzero(filled)]
    patch = patch[patch >= 0]
    whole = pieces_at(triangles, resolution, parts.patches.triangle[patch], parts.patches.texel[patch])
    pieces = joined_pieces([border.part(chosen[key]), whole])
    return _samples_of(triangles, pieces, resolution, points), points


def _affordable(chosen: np.ndarray, points: int) -> tuple[np.ndarray, int]:
    """Return the texels, (t,) bool, that have several points, and how many points each has."""
    texels = np.flatnonzero(chosen)
    while points > _FEWEST and points * len(texels) > _MOST_POINTS:
        points //= 4
    kept = np.zeros_like(chosen)
    kept[texels[:: max(1, -(-points * len(texels) // _MOST_POINTS))]] = True
    return kept, points


def _patches_of(parts: Subdivision, shape: tuple[int, ...]) -> np.ndarray:
    """Return the patch that lies on each texel, (atlases, r, r) int64, -1 for none."""
    patches = parts.patches
    chosen = np.flatnonzero(patches.atlas < shape[0])
    own = np.full(shape, -1, np.int64)
    own.reshape(shape[0], -1)[patches.atlas[chosen], patches.texel[chosen]] = chosen
    return own


def _shows_several(parts: Subdivision, border: TexelPieces, own: np.ndarray) -> np.ndarray:
    """Return the texels, (atlases, r, r) bool, that are partly covered, or by faces of several planes."""
    key = border.atlas.astype(np.int64) * parts.patches.resolution**2 + border.texel
    covered = np.bincount(key, border.area, own.size)
    order = np.argsort(key, kind="stable")
    first = np.r_[True, np.diff(key[order]) > 0][: len(key)]
    leader = order[np.maximum.accumulate(np.where(first, np.arange(len(key)), 0))]
    normals = parts.geometry.steps.geometric[border.triangle]
    bent = (normals[order] * normals[leader]).sum(axis=1) < _FLAT
    several = (covered > 0) & (covered < _WHOLE)
    several[key[order[bent]]] = True

    # Of texels whose centre nobody covers, slivers are left to those beside them.
    several &= (own.ravel() >= 0) | (covered > _SLIVER)
    return several.reshape(own.shape)


def _at_an_end(has_patch: np.ndarray) -> np.ndarray:
    """Return the texels, (atlases, r, r) bool, that have no neighbour along an axis."""
    end = np.zeros_like(has_patch)
    for axis in (1, 2):
        padded = np.pad(has_patch, [(0, 0), *((int(axis == a),) * 2 for a in (1, 2))])
        size = has_patch.shape[axis]
        before, after = (np.take(padded, range(start, start + size), axis=axis) for start in (0, 2))
        end |= ~(before | after)
    return end


def _on_edge(own: np.ndarray, known: PatchLight) -> np.ndarray:
    """Return the texels, (atlases, r, r) bool, whose light or view is not the mean of their neighbours'."""
    has_patch = own >= 0
    light, front = (np.where(has_patch, values[own], np.nan) for values in (known.light, known.front))
    floor = _DARK * float(known.light.mean())
    off = np.fmax(*(_off_mean(light, axis, floor) for axis in (1, 2)))
    noise = float(np.median(off[has_patch])) if has_patch.any() else 0.0
    edge = off > max(_EDGE, _ABOVE_NOISE * noise)
    edge |= np.fmax(*(_off_mean(front, axis, 1.0) for axis in (1, 2))) > _EDGE_OF_BACKS

    # Texels on both sides of a border of what is hidden.
    hidden = has_patch & known.hidden[own]
    visible = has_patch & ~hidden
    for image, other, mask in zip(edge, hidden, visible, strict=True):
        image |= (mask & grown(other)) | (other & grown(mask))
    return edge & has_patch


def _off_mean(values: np.ndarray, axis: int, floor: float) -> np.ndarray:
    """Return how far values are from the mean of two neighbours along an axis, relative to the largest.

    values: (atlases, r, r), NaN where nothing is; there a neighbour counts as equal. A value counts as
    `floor` at least.
    """
    padded = np.pad(values, [(0, 0), *((int(axis == a),) * 2 for a in (1, 2))], constant_values=np.nan)
    size = values.shape[axis]
    before, after = (np.take(padded, np.arange(start, start + size), axis=axis) for start in (0, 2))
    before, after = np.where(np.isnan(before), values, before), np.where(np.isnan(after), values, after)
    largest = np.fmax(np.fmax(before, after), np.fmax(values, floor))
    off: np.ndarray = np.abs(values - (before + after) / 2) / np.maximum(largest, 1e-30)
    return np.nan_to_num(off)


def _samples_of(triangles: Triangles, pieces: TexelPieces, resolution: int, points: int) -> DisplaySamples:
    """Return the samples of texels whose pieces are given."""
    pieces = pieces.part(
        np.argsort(pieces.atlas.astype(np.int64) * resolution**2 + pieces.texel, kind="stable")
    )
    piece, weight, found = place_points(triangles, pieces, resolution, points)
    triangle, barycentric = pieces.triangle[piece], found.astype(np.float32)
    return DisplaySamples(
        pieces.atlas[piece], pieces.texel[piece], on_lightmap(triangles, triangle, barycentric, resolution),
        weight.astype(np.float32), triangle, barycentric,
    )  # fmt: skip


def on_lightmap(
    triangles: Triangles, triangle: np.ndarray, barycentric: np.ndarray, resolution: int
) -> np.ndarray:
    """Return where points of triangles are on their lightmap, (s, 2) float32, texels."""
    uvs = np.einsum("sk,skd->sd", barycentric, triangles.uvs[triangle])
    return (uvs * resolution).astype(np.float32)
