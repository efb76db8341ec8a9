"""Light tree: binary tree over emitters with bounds that estimate the irradiance of each subtree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.device_struct import DeviceStruct
from .emitters import EMITTER, EMITTER_RECORDS, POINT, SKY_MAP, SUN

#: Inner node: total emission of all emitters below it. The intensity along a unit vector w is alike +
#: directed * (normal . w + sqrt(w . M w)), where M is a symmetric matrix.
LIGHT_NODE = DeviceStruct(
    "LightNode",
    ("float[3]", "centre", "m, of power"),
    ("float", "radius", "m, of the bounding ball about the centre; infinite if an emitter is infinitely far"),
    ("float[3]", "axis", "unit, of the bounding cone of emission directions"),
    ("float", "cos_half_angle", "of the cone"),
    ("float[3]", "normal", "mean normal of one-sided emitters, weighted by their share of `directed`"),
    ("float", "alike", "isotropic power"),
    ("float[3]", "squares", "xx, yy, zz of M"),
    ("float", "directed", "power along normals, sum of both sides"),
    ("float[3]", "products", "xy, xz, yz of M"),
    ("int[2]", "children", "inner nodes, or the complements of emitters"),
)

#: Device structs of kernels that use the tree.
LIGHT_TREE_RECORDS: tuple[DeviceStruct, ...] = (*EMITTER_RECORDS, LIGHT_NODE)


#: Fields of EMITTER from which the bounds of tree nodes are computed.
_BOUNDED = (
    "luminance", "position", "edge1", "edge2", "spread", "direction", "radius", "cos_half_angle",
    "cone_x", "cone_y", "cone_z",
)  # fmt: skip


@dataclass(frozen=True)
class LightTree:
    """Binary tree over emitters.

    nodes:  (m,) LIGHT_NODE
    root:   index of an inner node, or the complement ~i of the only emitter
    """

    nodes: np.ndarray
    root: int


@dataclass(frozen=True)
class _Emitters:
    """Bounds and power of emitters at finite distance, (k, ...) float64.

    low, high:    (k, 3), bounding boxes, metres
    axis, angle:  (k, 3), (k,) cone of emission directions; half angle, radians
    totals:       (k, 15), quantities that are summed over a node's emitters: power, power times centre (3),
                  isotropic power, power a along the normals n of both sides, a n of one-sided emitters (3),
                  and a n n: xx, yy, zz, xy, xz, yz
    """

    low: np.ndarray
    high: np.ndarray
    axis: np.ndarray
    angle: np.ndarray
    totals: np.ndarray


def build_light_tree(records: np.ndarray) -> LightTree:
    """Build the light tree of (k,) EMITTER records, k >= 1.

    Each node splits its emitters in halves along the longest axis, so the depth is ceil(log2 k). Emitters
    without inverse-square falloff (suns, sky, lights with a falloff node) form a chain above the tree. Bounds
    as in Conty Estevez and Kulla 2018.
    """
    assert records.dtype == EMITTER.dtype
    endless = np.isin(records["kind"], (SUN, SKY_MAP)) | (records["falloff_power"] > 0)
    chain, bounded = np.flatnonzero(endless), np.flatnonzero(~endless)
    if len(bounded):
        nodes = _halved(_emitters(records[bounded]))
    else:
        bounded, chain, nodes = chain[-1:], chain[:-1], LIGHT_NODE.array(0)
    top, children = len(chain), nodes["children"]
    nodes["children"] = np.where(children >= 0, children + top, ~bounded[~np.minimum(children, -1)])

    # The chain comes first: each of its nodes has one emitter and the rest of the tree as children.
    follows = np.arange(1, top + 1)
    if not len(nodes):
        follows[-1:] = ~bounded[0]
    above = LIGHT_NODE.array(top, radius=np.inf, children=np.stack([~chain, follows], axis=1))
    nodes = LIGHT_NODE.joined([above, nodes])
    return LightTree(nodes, 0 if len(nodes) else ~int(bounded[0]))


def _emitters(records: np.ndarray) -> _Emitters:
    """Return boxes, cones and powers of point lights, spot lights and triangles."""
    floats = {name: records[name].astype(np.float64) for name in _BOUNDED}
    point = records["kind"] == POINT
    position, reach = floats["position"], np.where(point, floats["radius"], 0)[:, None]
    corners = position[:, None] + np.stack([0 * position, floats["edge1"], floats["edge2"]], axis=1)
    low, high, centre = corners.min(axis=1) - reach, corners.max(axis=1) + reach, corners.mean(axis=1)

    # Points emit isotropically, triangles along their normals, on both sides or one.
    normal = np.cross(floats["edge1"], floats["edge2"])
    twice = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(twice, 1e-30)[:, None]
    lamp = ~point & (records["triangle"] < 0)
    one_sided = lamp | (records["one_sided"] > 0)
    alike = np.where(point, floats["luminance"], 0)
    along = np.where(point, 0, floats["luminance"] * twice / 2)
    side = np.where(one_sided, along / 2, along)
    power = alike + along
    outer = side[:, None] * normal[:, [0, 1, 2, 0, 0, 1]] * normal[:, [0, 1, 2, 1, 2, 2]]
    facing = np.where(one_sided, side, 0)[:, None] * normal
    totals = np.column_stack([power, power[:, None] * centre, alike, side, facing, outer])

    # Cones: of spots, widened for non-uniform scale; of area lights, their spread.
    spot = point & (floats["cos_half_angle"] >= -1)
    stretch = [1 / np.maximum(np.linalg.norm(floats[name], axis=1), 1e-30) for name in ("cone_x", "cone_y")]
    half = np.arccos(np.clip(floats["cos_half_angle"], 0, 1))
    half = np.arctan2(np.sin(half) * np.maximum(*stretch) * np.abs(floats["cone_z"]), np.cos(half))
    spread = np.where(lamp, np.minimum(floats["spread"], np.pi / 2), np.pi / 2)
    angle = np.where(spot, half, np.where(one_sided, spread, np.pi))
    axis = np.where(spot[:, None], floats["direction"], normal)
    return _Emitters(low, high, axis, angle, totals)


def _halved(emitters: _Emitters) -> np.ndarray:
    """Build the balanced tree; return its inner nodes, (m,) LIGHT_NODE, level by level, numbered from 0."""
    order = np.arange(len(emitters.angle))
    first, count = np.zeros(1, np.int64), np.full(1, len(order))
    middle = (emitters.low + emitters.high) / 2
    nodes, made = [LIGHT_NODE.array(0)], 0
    while True:
        # Select the nodes of this level with more than one emitter.
        inner = count > 1
        first, count = first[inner], count[inner]
        if not len(first):
            return LIGHT_NODE.joined(nodes)
        starts = np.cumsum(count) - count
        node = np.repeat(np.arange(len(first)), count)
        position = np.arange(len(node)) - starts[node] + first[node]
        members = order[position]
        nodes.append(_nodes(emitters, members, starts, node))

        # Split each node in halves along its longest axis.
        low, high = np.minimum.reduceat(middle[members], starts), np.maximum.reduceat(middle[members], starts)
        along = middle[members, (high - low).argmax(axis=1)[node]]
        order[position] = members[np.lexsort((along, node))]
        left = (count + 1) // 2
        first, count = _interleaved(first, first + left), _interleaved(left, count - left)

        # Number the children that are inner nodes consecutively.
        made += len(left)
        number = np.where(count > 1, made + np.cumsum(count > 1) - 1, ~order[first])
        nodes[-1]["children"] = number.reshape(-1, 2)


def _interleaved(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Interleave two arrays: first[0], second[0], first[1], second[1], and so on."""
    return np.stack([first, second], axis=1).ravel()


def _nodes(emitters: _Emitters, members: np.ndarray, starts: np.ndarray, node: np.ndarray) -> np.ndarray:
    """Compute bounds of nodes, (k,) LIGHT_NODE; the `members` of node i begin at starts[i]."""
    totals = np.add.reduceat(emitters.totals[members], starts)
    power, alike, along = totals[:, 0], totals[:, 4], totals[:, 5]
    directed = totals[:, 6:] / np.maximum(along, 1e-300)[:, None]
    low = np.minimum.reduceat(emitters.low[members], starts)
    high = np.maximum.reduceat(emitters.high[members], starts)
    centre = np.where(power[:, None] > 0, totals[:, 1:4] / np.maximum(power, 1e-300)[:, None], low)

    # Bounding cone about the mean axis.
    axis = np.add.reduceat(emitters.axis[members], starts)
    axis /= np.maximum(np.linalg.norm(axis, axis=1), 1e-30)[:, None]
    cosine = np.einsum("nd,nd->n", axis[node], emitters.axis[members])
    angle = np.maximum.reduceat(np.arccos(np.clip(cosine, -1, 1)) + emitters.angle[members], starts)

    return LIGHT_NODE.array(
        len(starts),
        centre=centre,
        axis=axis,
        normal=directed[:, :3],
        squares=directed[:, 3:6],
        products=directed[:, 6:],
        radius=np.linalg.norm(np.maximum(centre - low, high - centre), axis=1),
        cos_half_angle=np.cos(np.minimum(angle, np.pi)),
        alike=alike,
        directed=along,
    )
