"""A tree over emitters: kernels/light_tree.cl tells from it what many of them bring to a patch at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .emitters import MODULATION, POINT, RECORD, SKY_MAP, SUN, surface_numbers

#: float4 a record of an inner node.
NODE = 5


@dataclass(frozen=True)
class LightTree:
    """Inner nodes, each with two children; a child is an inner node or the complement of an emitter.

    nodes     (m, NODE, 4) float32: centre of power, radius of a ball about it that holds all emitters
              (infinite if some have no place) | axis of a cone that holds all directions in which they
              shine, cosine of its half angle | vector n, power p that goes everywhere alike | xx, yy, zz
              of a matrix M, power q | xy, xz, yz of M, 0: along w goes p + q (n . w + sqrt(w . M w))
    children  (m, 2) int32
    root      an inner node or the complement of the only emitter
    """

    nodes: np.ndarray
    children: np.ndarray
    root: int


@dataclass(frozen=True)
class _Emitters:
    """What the tree needs to know of emitters that have a place, (k, ...) float64.

    low, high    (k, 3), boxes, metres
    axis, angle  (k, 3), (k,) cone of the directions in which they shine; half angle, radians
    totals       (k, 15), sums over a node's emitters: power, power times centre (3), power that goes
                 everywhere alike, power a along the normals n of both sides, a n of one-sided ones (3),
                 and a n n: xx, yy, zz, xy, xz, yz
    """

    low: np.ndarray
    high: np.ndarray
    axis: np.ndarray
    angle: np.ndarray
    totals: np.ndarray


def build_light_tree(records: np.ndarray) -> LightTree:
    """Build the tree of emitters, (k, RECORD, 4) float32 as of engine/direct/emitters.py, at least one.

    Each node halves its emitters along the widest axis, so that it is ceil(log2 k) deep; those whose light
    does not fade with the square of the distance, suns, sky and lamps with a falloff, form a chain above it.
    Bounds as in Conty Estevez and Kulla 2018.
    """
    assert records.shape[1:] == (RECORD, 4)
    endless = np.isin(records[:, 0, 0], (SUN, SKY_MAP)) | (records[:, MODULATION, 1] > 0)
    chain, placed = np.flatnonzero(endless), np.flatnonzero(~endless)
    if not len(placed):
        placed, chain = chain[-1:], chain[:-1]
        nodes, children = np.zeros((0, NODE, 4)), np.zeros((0, 2), np.int64)
    else:
        nodes, children = _halved(_emitters(records[placed]))
    top = len(chain)
    children = np.where(children >= 0, children + top, ~placed[~np.minimum(children, -1)])

    # The chain takes the first numbers: an emitter, and all that follows.
    above = np.zeros((top, NODE, 4))
    above[:, 0, 3] = np.inf
    follows = np.arange(1, top + 1)
    if not len(nodes):
        follows[-1:] = ~placed[0]
    links = np.stack([~chain, follows], axis=1)
    nodes, children = np.concatenate([above, nodes]), np.concatenate([links, children])
    root = 0 if len(nodes) else ~int(placed[0])
    return LightTree(nodes.astype(np.float32), children.astype(np.int32), root)


def _emitters(records: np.ndarray) -> _Emitters:
    """Return boxes, cones and powers of points, spots and triangles."""
    rows = records[..., :3].astype(np.float64)
    strength, last = rows[:, 0, 1], records[..., 3].astype(np.float64)
    point = records[:, 0, 0] == POINT
    reach = np.where(point, last[:, 1], 0)[:, None]
    offsets = np.where(point[:, None, None], 0, np.stack([0 * rows[:, 2], rows[:, 2], rows[:, 3]], axis=1))
    corners = rows[:, 1, None] + offsets
    low, high, centre = corners.min(axis=1) - reach, corners.max(axis=1) + reach, corners.mean(axis=1)

    # Points shine everywhere alike, triangles along their normals: all of them, or one side.
    normal = np.cross(offsets[:, 1], offsets[:, 2])
    twice = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(twice, 1e-30)[:, None]
    lamp = ~point & (surface_numbers(records) < 0)
    one_sided = lamp | (~point & (rows[:, 5, 2] > 0))
    alike = np.where(point, strength, 0)
    along = np.where(point, 0, strength * twice / 2)
    side = np.where(one_sided, along / 2, along)
    power = alike + along
    outer = side[:, None] * normal[:, [0, 1, 2, 0, 0, 1]] * normal[:, [0, 1, 2, 1, 2, 2]]
    facing = np.where(one_sided, side, 0)[:, None] * normal
    totals = np.column_stack([power, power[:, None] * centre, alike, side, facing, outer])

    # Cones: of spots, widened where they are squeezed; of area lights, their spread.
    spot = point & (last[:, 2] >= -1)
    stretch = [1 / np.maximum(np.linalg.norm(rows[:, row], axis=1), 1e-30) for row in (4, 5)]
    half = np.arccos(np.clip(last[:, 2], 0, 1))
    half = np.arctan2(np.sin(half) * np.maximum(*stretch) * np.abs(last[:, 5]), np.cos(half))
    spread = np.where(lamp, np.minimum(last[:, 4], np.pi / 2), np.pi / 2)
    angle = np.where(spot, half, np.where(one_sided, spread, np.pi))
    return _Emitters(low, high, np.where(spot[:, None], rows[:, 2], normal), angle, totals)


def _halved(emitters: _Emitters) -> tuple[np.ndarray, np.ndarray]:
    """Return records and children of the inner nodes, level by level."""
    order = np.arange(len(emitters.angle))
    first, count = np.zeros(1, np.int64), np.full(1, len(order))
    middle = (emitters.low + emitters.high) / 2
    nodes, children, made = [np.zeros((0, NODE, 4))], [np.zeros((0, 2), np.int64)], 0
    while True:
        # The nodes of this level that have more than one emitter.
        inner = count > 1
        first, count = first[inner], count[inner]
        if not len(first):
            return np.concatenate(nodes), np.concatenate(children)
        starts = np.cumsum(count) - count
        owner = np.repeat(np.arange(len(first)), count)
        place = np.arange(len(owner)) - starts[owner] + first[owner]
        members = order[place]
        nodes.append(_records(emitters, members, starts, owner))

        # Halve each along its widest axis.
        low, high = np.minimum.reduceat(middle[members], starts), np.maximum.reduceat(middle[members], starts)
        along = middle[members, (high - low).argmax(axis=1)[owner]]
        order[place] = members[np.lexsort((along, owner))]
        left = (count + 1) // 2
        first, count = _interleaved(first, first + left), _interleaved(left, count - left)

        # Children that are inner nodes are numbered as they come.
        made += len(left)
        number = np.where(count > 1, made + np.cumsum(count > 1) - 1, ~order[first])
        children.append(number.reshape(-1, 2))


def _interleaved(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return first[0], second[0], first[1], second[1], ..."""
    return np.stack([first, second], axis=1).ravel()


def _records(emitters: _Emitters, members: np.ndarray, starts: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """Return the records of nodes, (k, NODE, 4) float64; members of a node follow its start."""
    totals = np.add.reduceat(emitters.totals[members], starts)
    power, alike, along = totals[:, 0], totals[:, 4], totals[:, 5]
    directed = totals[:, 6:] / np.maximum(along, 1e-300)[:, None]
    low = np.minimum.reduceat(emitters.low[members], starts)
    high = np.maximum.reduceat(emitters.high[members], starts)
    centre = np.where(power[:, None] > 0, totals[:, 1:4] / np.maximum(power, 1e-300)[:, None], low)

    # A cone about the mean axis.
    axis = np.add.reduceat(emitters.axis[members], starts)
    axis /= np.maximum(np.linalg.norm(axis, axis=1), 1e-30)[:, None]
    cosine = np.einsum("nd,nd->n", axis[owner], emitters.axis[members])
    angle = np.maximum.reduceat(np.arccos(np.clip(cosine, -1, 1)) + emitters.angle[members], starts)

    records = np.zeros((len(starts), NODE, 4))
    records[:, 0, :3] = centre
    records[:, 0, 3] = np.linalg.norm(np.maximum(centre - low, high - centre), axis=1)
    records[:, 1, :3], records[:, 1, 3] = axis, np.cos(np.minimum(angle, np.pi))
    records[:, 2, :3], records[:, 2, 3] = directed[:, :3], alike
    records[:, 3, :3], records[:, 3, 3] = directed[:, 3:6], along
    records[:, 4, :3] = directed[:, 6:]
    return records
