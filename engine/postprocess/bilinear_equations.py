"""Least-squares equations of the texel values: light samples, UV seams and smoothness.

The unknowns are the values of the texels. One row for each sample demands that the bilinear lookup at the
sample equals its light. One row for each pair of seam points demands equal lookups on both sides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..patches.seams import Seams
from .bilinear import beside_centres, cell_sides, footprints
from .ell_matrix import EllMatrix
from .lightmap_points import LightmapPoints
from .texel_stencil import TexelStencil

#: Weights of the seam rows for each texel of seam length, and of the smoothness rows for each pair of
#: neighbours. A sample that represents a whole texel has weight 1. Both values are chosen.
_SEAM, _SMOOTHNESS = 30.0, 0.01

#: Diagonal of the sample equations above which the samples alone determine a texel. It is a third of the
#: diagonal with samples on all sides.
_KNOWN = 0.15

#: Minimum lookup weight with which a sample, or one side of a seam, determines a texel.
_TELLS = 1e-3


@dataclass(frozen=True)
class BilinearEquations:
    """Least-squares equations of the texels that bilinear lookups at off-centre samples or at seams read.

    texel:       (n,) int64, flat index of each unknown
    point:       (m,) int64, index of each point that reads unknowns
    footprints:  (m, 4) int64, numbers of the unknowns that each point reads
    weights:     (m, 4) float64, lookup weight times the weight of the point
    points:      normal matrix of the sample equations
    seams:       rows of the seam equations: equal lookups on both sides
    smooth:      rows that make neighbours equal where samples hardly determine one of them
    """

    texel: np.ndarray
    point: np.ndarray
    footprints: np.ndarray
    weights: np.ndarray
    points: TexelStencil
    seams: EllMatrix
    smooth: EllMatrix


def display_equations(
    points: LightmapPoints, seams: Seams, resolution: int, atlases: int
) -> BilinearEquations:
    """Return the equations of all lightmaps.

    The unknowns are the texels that bilinear lookups at off-centre points read. A lookup at a seam adds its
    texels if a sample determines any of them on either side. A chart's tip without samples thus takes the
    light of the other side.
    """
    texel = points.texels(resolution)
    off_centre = beside_centres(points.position)
    around, shares = footprints(points.atlas[off_centre], points.position[off_centre], resolution)
    determined = np.zeros(atlases * resolution**2, bool)
    determined[texel] = determined[around[shares > _TELLS]] = True
    sides, differences, length = _seam_sides(seams, determined, resolution)
    unknown = np.zeros_like(determined)
    unknown[around[shares > 0]] = unknown[sides[differences != 0]] = True
    number = np.cumsum(unknown, dtype=np.int32) - np.int32(1)
    count = int(unknown.sum())

    # Each point in an unknown texel gives an equation; all texels that its lookup reads are unknowns too.
    point = np.flatnonzero(unknown[texel])
    read, weights = footprints(points.atlas[point], points.position[point], resolution)
    read, weight = _numbered(number, read, weights), points.weight[point].astype(np.float64)
    stencil = TexelStencil(read, weights, weight, count)
    seam_rows = EllMatrix(
        _numbered(number, sides, differences), differences * np.sqrt(_SEAM * length)[:, None], count
    )
    cells = cell_sides(
        np.concatenate([around, sides[:, :4], sides[:, 4:]]),
        np.concatenate([shares, differences[:, :4], -differences[:, 4:]]),
        len(determined),
    )
    smooth = _smoothness(number[cells].astype(np.intp), stencil.diagonal)
    return BilinearEquations(
        texel=np.flatnonzero(unknown),
        point=point,
        footprints=read,
        weights=weights * weight[:, None],
        points=stencil,
        seams=seam_rows,
        smooth=smooth,
    )


def _numbered(number: np.ndarray, texels: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the unknown of each lookup texel, (m, k). Texels of weight 0 get the heaviest texel's."""
    most = np.take_along_axis(texels, np.abs(weights).argmax(axis=1)[:, None], axis=1)
    numbers: np.ndarray = number[np.where(weights == 0, most, texels)].astype(np.intp)
    return numbers


def _seam_sides(
    seams: Seams, determined: np.ndarray, resolution: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the lookups on both sides of the seams where samples determine at least one side.

    seams:       pairs of points on both sides of seams
    determined:  (atlases * r * r,) bool, texels that samples determine

    Returns the texels of both sides, (p, 8) int64, their weights, (p, 8) float64, negative on the second
    side, and the seam length that each pair represents, (p,), texels.
    """
    first, second = (footprints(seams.atlas[:, side], seams.texel[:, side], resolution) for side in (0, 1))
    known = [(determined[texels] & (weights > _TELLS)).any(axis=1) for texels, weights in (first, second)]
    one = known[0] | known[1]
    sides = np.concatenate([first[0], second[0]], axis=1)[one]
    return sides, np.concatenate([first[1], -second[1]], axis=1)[one], seams.weight[one]


def _smoothness(sides: np.ndarray, diagonal: np.ndarray) -> EllMatrix:
    """Return smoothness rows for pairs of neighbours, (s, 2) int64, where one has almost no samples."""
    unknown = 1 - diagonal[sides].min(axis=1) / _KNOWN
    sides, weight = sides[unknown > 0], _SMOOTHNESS * unknown[unknown > 0]
    return EllMatrix(sides, np.sqrt(weight)[:, None] * [1.0, -1.0], len(diagonal))
