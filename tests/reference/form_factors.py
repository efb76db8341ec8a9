"""Matrix of form factors between all patches.

The sign of F_ij states which side of patch j is visible from patch i. The sides differ: the front emits and
reflects, the back only emits. Patch i receives on the side of its shading normal.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from engine.patches.geometry import PatchGeometry
from engine.scene.model import Scene

from .analytic import polygon
from .planar_pieces import PlanarPieces, blockers, surfaces

#: Distance in edge lengths below which Lambert's formula is used. Beyond it the point formula A cos cos / (pi
#: r^2) errs by less than edge^2 / (3 r^2) = 0.17 %.
NEAR = 14.0

#: Points per axis of the grid that measures the visible fraction of a near patch.
NEAR_SAMPLES = 4

#: Number of pairs processed at once, chosen to fit the CPU cache.
PAIRS = 1 << 17

#: Distance from either end of a line of sight, as a fraction of its length, within which nothing occludes.
GRAZE = 1e-5


def form_factors(geometry: PatchGeometry, scene: Scene) -> np.ndarray:
    """Return the form factors F_ij from the centre of patch i to the parallelogram of patch j.

    Far pairs use A_j cos_i cos_j / (pi r^2) (Cohen and Greenberg 1985), near ones Lambert's polygon formula
    clipped to the horizon. Both are multiplied by the visible fraction of patch j, from exact intersection
    with the planar pieces of the scene.

    geometry:  of n patches; each is a full texel, even where a chart covers only a part
    scene:     scene whose triangles occlude

    Returns (n, n) float32, 4 n^2 bytes: F_ij where the front of j is visible, -F_ij for its back. In a closed
    room the magnitudes of every row sum to 1.
    """
    pieces = surfaces(scene, geometry.triangles)
    of_patch = pieces.of_triangle[geometry.triangle]
    members = {int(s): np.flatnonzero(of_patch == s) for s in np.unique(of_patch)}
    may_block = blockers(pieces)
    matrix = np.zeros((len(of_patch), len(of_patch)), np.float32)
    for source, rows in members.items():
        for target, columns in members.items():
            if source != target and _faces(geometry, rows, pieces, target):
                walls = np.flatnonzero(may_block[:, source, target])
                for part in _chunks(rows, len(columns)):
                    matrix[np.ix_(part, columns)] = _block(geometry, part, columns, pieces, walls)
    return matrix


def _faces(geometry: PatchGeometry, rows: np.ndarray, pieces: PlanarPieces, target: int) -> bool:
    """Return True if any part of a piece is above the horizon of any of the patches."""
    normal = geometry.normal[rows]
    height = normal @ pieces.corners()[target].T - (normal * geometry.center[rows]).sum(1)[:, None]
    return bool((height > 0).any())


def _chunks(rows: np.ndarray, columns: int) -> Iterator[np.ndarray]:
    """Cut rows into parts of at most PAIRS pairs."""
    step = max(1, PAIRS // columns)
    for first in range(0, len(rows), step):
        yield rows[first : first + step]


def _block(
    geometry: PatchGeometry, rows: np.ndarray, columns: np.ndarray, pieces: PlanarPieces, walls: np.ndarray
) -> np.ndarray:
    """Return the form factors from the patches `rows` to the patches `columns`, (r, c) float32."""
    factor, square = _far(geometry, rows, columns)
    if len(walls):
        visible = np.ones(factor.shape, bool)
        for wall in walls:
            visible &= _misses(geometry.center[rows], geometry.center[columns], pieces, wall)
        factor *= visible

    # Near pairs use the polygon formula.
    reach = NEAR * _edge_lengths(geometry, columns)
    row, column = np.nonzero(square < reach[None, :] ** 2)
    if len(row):
        factor[row, column] = _near(geometry, rows[row], columns[column], pieces, walls)
    return factor


def _far(geometry: PatchGeometry, rows: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return +-A_j cos_i cos_j / (pi r^2) without occlusion, and r^2 (m^2), (r, c) float32."""
    middle = geometry.center[rows].mean(axis=0)
    here, there = geometry.center[rows] - middle, geometry.center[columns] - middle
    normal, facing = geometry.normal[rows], geometry.geometric[columns]
    square = (there[None, :, 0] - here[:, None, 0]) ** 2
    square += (there[None, :, 1] - here[:, None, 1]) ** 2
    square += (there[None, :, 2] - here[:, None, 2]) ** 2
    leaving: np.ndarray = normal @ there.T - (normal * here).sum(1)[:, None]
    arriving = here @ facing.T - (facing * there).sum(1)
    factor = np.maximum(leaving, 0, out=leaving)
    factor *= arriving
    factor *= geometry.area[columns] / np.float32(np.pi)
    factor /= np.maximum(square * square, np.finfo(np.float32).tiny)
    return factor, square


def _edge_lengths(geometry: PatchGeometry, patches: np.ndarray) -> np.ndarray:
    """Return the longer edge of each patch, metres."""
    lengths = [np.linalg.norm(edge[patches], axis=1) for edge in (geometry.edge_u, geometry.edge_v)]
    longer: np.ndarray = np.maximum(*lengths)
    return longer


def _near(
    geometry: PatchGeometry, source: np.ndarray, target: np.ndarray, pieces: PlanarPieces, walls: np.ndarray
) -> np.ndarray:
    """Return the form factors of pairs of near patches, signed as in the matrix, (p,) float64."""
    center = geometry.center[source].astype(np.float64)
    middle = geometry.center[target].astype(np.float64)
    edge_u, edge_v = geometry.edge_u[target], geometry.edge_v[target]
    signs = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
    corners = np.stack([middle + a * edge_u + b * edge_v for a, b in signs], axis=1)
    factor: np.ndarray = np.abs(polygon(center, geometry.normal[source], corners))
    factor = np.copysign(factor, ((center - middle) * geometry.geometric[target]).sum(axis=1))
    if not len(walls):
        return factor

    # Visible fraction of each patch, on a grid of points.
    steps = (np.arange(NEAR_SAMPLES) + 0.5) / NEAR_SAMPLES - 0.5
    visible = np.zeros(len(factor))
    for a in steps:
        for b in steps:
            seen = np.ones(len(factor), bool)
            for wall in walls:
                seen &= _misses(center, middle + a * edge_u + b * edge_v, pieces, wall, paired=True)
            visible += seen / NEAR_SAMPLES**2
    factor *= visible
    return factor


def _misses(
    here: np.ndarray, there: np.ndarray, pieces: PlanarPieces, wall: int, paired: bool = False
) -> np.ndarray:
    """Return True where the line between two points misses a piece.

    here, there:  (r, 3) and (c, 3) float, metres from `Triangles.origin`; r = c with `paired`

    Returns (r, c) bool, or (r,) with `paired`.
    """
    start, end = _local(here, pieces, wall), _local(there, pieces, wall)
    if not paired:
        start = [values[:, None] for values in start]
        end = [values[None, :] for values in end]
    (height, u, v), (end_height, end_u, end_v) = start, end

    # A line crosses the plane at the fraction t of its length; parallel lines never do.
    rise = height - end_height
    t = np.divide(height, rise, out=np.full(rise.shape, -1, np.float32), where=rise != 0)
    miss: np.ndarray = (t <= GRAZE) | (t >= 1 - GRAZE)
    at_u = u + t * (end_u - u)
    miss |= at_u < 0
    at_v = v + t * (end_v - v)
    miss |= at_v < 0
    miss |= at_u + at_v > 1 if pieces.triangular[wall] else (at_u > 1) | (at_v > 1)
    return miss


def _local(points: np.ndarray, pieces: PlanarPieces, wall: int) -> list[np.ndarray]:
    """Return the height of points above a piece (metres) and their coordinates a, b, each (p,) float32."""
    edges = np.stack([pieces.normal[wall], pieces.edge_u[wall], pieces.edge_v[wall]], axis=1)
    coordinates = np.linalg.solve(edges, (points - pieces.origin[wall]).T)
    return list(coordinates.astype(np.float32))
