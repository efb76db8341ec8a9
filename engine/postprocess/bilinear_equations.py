"""What the bilinear display shall show, as equations of texels: points, seams, smoothness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..patches.seams import Seams
from .bilinear import beside_centres, cell_sides, footprints
from .ell_matrix import EllMatrix
from .lightmap_points import LightmapPoints
from .texel_stencil import TexelStencil

#: Weights of a texel of a seam's length, and of a step between neighbours, where a point that stands for a
#: whole texel has 1.
_SEAM, _SMOOTHNESS = 30.0, 0.01

#: A texel with this on the diagonal is known by its points alone: a third of what it has where points lie
#: everywhere around it.
_KNOWN = 0.15

#: A point tells about texels that have at least this weight in its footprint; so does a side of a seam.
_TELLS = 1e-3


@dataclass(frozen=True)
class BilinearEquations:
    """Equations of those texels that have more to show than the light in their centre.

    texel       (n,) int64, flat index of each unknown
    point       (m,) int64, the points that count for them
    footprints  (m, 4) int64, the unknowns that these points read
    weights     (m, 4) float64, the weights of these unknowns, times that of the point
    points      least squares of what the points show
    seams       both sides of a seam show the same
    smooth      neighbours of which one is hardly known are the same
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
    """Return the equations of the lightmaps.

    Unknown are texels that points beside centres read, and texels that both sides of a seam read, if some
    point tells about one of them: the tip of a chart, where no texel has a point, shows what the other side
    shows.
    """
    texel = points.texels(resolution)
    beside = beside_centres(points.position)
    around, shares = footprints(points.atlas[beside], points.position[beside], resolution)
    told = np.zeros(atlases * resolution**2, bool)
    told[texel] = told[around[shares > _TELLS]] = True
    sides, differences, length = _seam_sides(seams, told, resolution)
    unknown = np.zeros_like(told)
    unknown[around[shares > 0]] = unknown[sides[differences != 0]] = True
    number = np.cumsum(unknown, dtype=np.int32) - np.int32(1)
    count = int(unknown.sum())

    # A point counts if its texel is unknown; then it reads nothing else.
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
        len(told),
    )
    smooth = _smoothness(number[cells].astype(np.intp), stencil.diagonal)
    return BilinearEquations(
        np.flatnonzero(unknown), point, read, weights * weight[:, None], stencil, seam_rows, smooth
    )


def _numbered(number: np.ndarray, texels: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the numbers of texels, (m, k); one without weight has that of the texel with the most."""
    most = np.take_along_axis(texels, np.abs(weights).argmax(axis=1)[:, None], axis=1)
    numbers: np.ndarray = number[np.where(weights == 0, most, texels)].astype(np.intp)
    return numbers


def _seam_sides(seams: Seams, told: np.ndarray, resolution: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return seams about one side of which points tell, at least.

    Texels of both sides, (p, 8) int64, their weights, negative on the second side, and the length that each
    pair of points stands for, (p,).
    """
    first, second = (footprints(seams.atlas[:, side], seams.texel[:, side], resolution) for side in (0, 1))
    known = [(told[texels] & (weights > _TELLS)).any(axis=1) for texels, weights in (first, second)]
    one = known[0] | known[1]
    sides = np.concatenate([first[0], second[0]], axis=1)[one]
    return sides, np.concatenate([first[1], -second[1]], axis=1)[one], seams.weight[one]


def _smoothness(sides: np.ndarray, diagonal: np.ndarray) -> EllMatrix:
    """Return the rows of those neighbours, (s, 2) int64, of which one is hardly known."""
    unknown = 1 - diagonal[sides].min(axis=1) / _KNOWN
    sides, weight = sides[unknown > 0], _SMOOTHNESS * unknown[unknown > 0]
    return EllMatrix(sides, np.sqrt(weight)[:, None] * [1.0, -1.0], len(diagonal))
