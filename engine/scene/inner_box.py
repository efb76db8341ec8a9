"""Box inside the outer walls of a scene, in which light probes are useful."""

from __future__ import annotations

import numpy as np

#: Lines across the box in each of two directions, and their places within the cells of a square grid (chosen
#: off diagonals, along which quads are split).
_LINES, _PLACES = 8, (0.46, 0.51)

#: Largest depth of a wall's inner face, as a fraction of the box's width; deeper faces are furniture
#: (chosen).
_DEEPEST = 0.25

#: Least fraction of lines that meet a wall on a closed side (chosen).
_CLOSED = 0.5


def inner_box(positions: np.ndarray) -> np.ndarray:
    """Return the box between the inner faces of outer walls, floors and ceilings, (2, 3) float64.

    Lines along each axis cross the triangles. On each side of the bounding box, the inner face of a wall is
    the first triangle that faces inwards; the box ends at the median of these faces. A side on which few
    lines meet a wall ends at the bounding box.

    positions:  (t, 3, 3) float, corners of t > 0 triangles, counter-clockwise from the front
    """
    corners = positions.reshape(-1, 3)
    box = np.array([corners.min(axis=0), corners.max(axis=0)], np.float64)
    inner = box.copy()
    for axis in range(3):
        line, place, facing = _crossings(positions, box, axis)
        for side, sign in enumerate((1, -1)):
            depth = sign * (place - box[side, axis])
            inner[side, axis] += sign * _wall_depth(
                line, np.where(sign * facing > 0, depth, np.inf), box[1, axis] - box[0, axis]
            )
    return inner


def _wall_depth(line: np.ndarray, depth: np.ndarray, width: float) -> float:
    """Return the median depth of the first crossing of each line; 0 if few lines meet a wall.

    line:   (k,) line of each crossing
    depth:  (k,) depth of each crossing below a side of the box, infinite if it faces outwards
    """
    first = np.full(_LINES**2, np.inf)
    np.minimum.at(first, line, depth)
    walls = first[first <= _DEEPEST * width]
    return float(np.median(walls)) if len(walls) >= _CLOSED * len(first) else 0.0


def _crossings(
    positions: np.ndarray, box: np.ndarray, axis: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return line, coordinate along the axis and facing of each crossing with a triangle, (k,) each.

    Facing is positive if the triangle faces along the axis.
    """
    across = [(axis + 1) % 3, (axis + 2) % 3]
    steps = np.maximum(box[1] - box[0], 1e-30)[across] / _LINES
    # In steps of the grid: line (i, j) is at (i, j).
    flat = (positions[..., across] - box[0][across]) / steps - _PLACES
    low, high = np.ceil(flat.min(axis=1)), np.floor(flat.max(axis=1))
    (near,) = np.nonzero((low <= high).all(axis=1))
    flat, low, high, heights = flat[near], low[near], high[near], positions[near, :, axis]
    found = []
    for number, (i, j) in enumerate(np.ndindex(_LINES, _LINES)):
        (met,) = np.nonzero(((low <= (i, j)) & (high >= (i, j))).all(axis=1))
        weights, facing = _barycentrics(flat[met], np.array((i, j)))
        hit = (weights >= 0).all(axis=1)
        place = (weights[hit] * heights[met[hit]]).sum(axis=1)
        found.append((np.full(len(place), number), place, facing[hit]))
    line, place, facing = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return line, place, facing


def _barycentrics(corners: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the barycentric coordinates of a point in triangles, (k, 3), and twice their signed areas, (k,).

    corners:  (k, 3, 2); triangles without area get -1
    """
    sides = corners - point
    turned = np.roll(sides, -1, axis=1)
    parts = np.roll(sides[..., 0] * turned[..., 1] - sides[..., 1] * turned[..., 0], 1, axis=1)
    area = parts.sum(axis=1)
    return np.where(area[:, None] != 0, parts / np.where(area, area, 1)[:, None], -1), area
