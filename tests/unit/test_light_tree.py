"""The tree over emitters on the host: every emitter once, bounds that hold, powers that add up."""

import numpy as np
import pytest

from engine import Light
from engine.direct.emitters import EMITTER, SUN, TRIANGLE, lamp_records, sky_record
from engine.direct.light_tree import build_light_tree


def emitters(count, seed=0):
    """Return records of triangles, lamps of all kinds and the sky."""
    rng = np.random.default_rng(seed)
    records = EMITTER.array(
        count,
        kind=TRIANGLE,
        luminance=rng.uniform(0.5, 2, count),
        position=rng.uniform(-5, 5, (count, 3)),
        edge1=rng.normal(0, 0.2, (count, 3)),
        edge2=rng.normal(0, 0.2, (count, 3)),
        one_sided=np.arange(count) % 2 == 0,
    )
    turned = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    kinds = ({"half_angle": 0.4, "kind": "spot", "radius": 0.1}, {"kind": "point"}, {"kind": "sun"})
    for index, values in enumerate(kinds[: (count + 2) // 3]):
        values = {"position": rng.uniform(-5, 5, 3), "axes": turned, "strength": np.ones(3), **values}
        records[3 * index] = lamp_records(Light("Lamp", **values))[0]
    if count > 8:
        records[8] = sky_record()[0]
    return records


def leaves_below(tree, code):
    """Return the emitters below a node."""
    stack, found = [code], []
    while stack:
        code = stack.pop()
        if code < 0:
            found.append(~code)
        else:
            stack += tree.nodes["children"][code].tolist()
    return np.array(found)


@pytest.mark.parametrize("count", [1, 2, 3, 9, 100])
def test_every_emitter_has_one_leaf(count):
    tree = build_light_tree(emitters(count))
    assert sorted(leaves_below(tree, tree.root)) == list(range(count))
    assert len(tree.nodes) == count - 1


def test_suns_alone_form_a_chain():
    tree = build_light_tree(EMITTER.array(3, kind=SUN))
    assert sorted(leaves_below(tree, tree.root)) == [0, 1, 2]
    assert np.isinf(tree.nodes["radius"]).all()


def test_bounds_hold_all_emitters_of_a_node():
    records = emitters(200)
    tree = build_light_tree(records)
    triangles = records["kind"] == TRIANGLE
    edge1, edge2 = records["edge1"], records["edge2"]
    corners = records["position"][:, None] + np.stack([0 * edge1, edge1, edge2], axis=1)
    normal = np.cross(edge1, edge2)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-20)
    for number, node in enumerate(tree.nodes):
        if np.isinf(node["radius"]):
            continue
        below = leaves_below(tree, number)
        below = below[triangles[below]]
        distance = np.linalg.norm(corners[below] - node["centre"], axis=2)
        assert (distance <= node["radius"] * 1.00001).all()

        # A cone of less than half a sphere holds the half spaces of one-sided triangles only as a whole.
        widest = np.arccos(np.clip(node["cos_half_angle"], -1, 1))
        angle = np.arccos(np.clip(normal[below] @ node["axis"], -1, 1)) + np.pi / 2
        one_sided = records["one_sided"][below] > 0
        assert (np.minimum(angle[one_sided], np.pi) <= widest + 1e-3).all()
        assert one_sided.all() or widest == pytest.approx(np.pi, abs=1e-3)


def test_power_along_a_direction():
    """Of one-sided triangles that face one way it is power times cosine; nothing goes behind them."""
    records = emitters(2)
    records["kind"], records["one_sided"] = TRIANGLE, 1
    records["edge1"], records["edge2"] = (0.1, 0, 0), (0, 0.1, 0)
    node = build_light_tree(records).nodes[0]
    matrix = np.diag(node["squares"]) + node["products"][0] * np.array([[0, 1, 0], [1, 0, 0], [0, 0, 0]])
    power = records["luminance"].sum() * 0.005
    for angle in (0.0, 1.0, 2.0, 3.0):
        way = np.array([np.sin(angle), 0, np.cos(angle)])
        shone = node["alike"] + node["directed"] * (node["normal"] @ way + np.sqrt(way @ matrix @ way))
        assert shone == pytest.approx(power * max(np.cos(angle), 0), abs=1e-6)
