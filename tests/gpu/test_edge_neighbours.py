"""Boxes of edges that overlap: all of them, once each, in one order, by the device and by the host."""

import numpy as np
import pytest

from engine.device.kernel import SideQueue
from engine.patches import device_edge_neighbours, host_edge_neighbours
from engine.patches.chart_edges import chart_edges
from engine.patches.device_edge_neighbours import DeviceNeighbours
from engine.patches.edge_boxes import EdgeBoxes, edge_boxes
from engine.patches.host_edge_neighbours import HostNeighbours
from engine.postprocess.seam_lookups import display_seams
from tests.unit.test_seams import R, cylinder, joined, tile


def random_boxes(seed, count, origin=0.0, spread=1.0):
    """Return boxes of sizes from 1e-3 to 10 m, whose normals are of few directions, some of them long."""
    random = np.random.default_rng(seed)
    low = origin + random.uniform(-spread, spread, (count, 3))
    side = 10 ** random.uniform(-3, 1, (count, 1)) * random.uniform(0.001, 1, (count, 3))
    normal = np.eye(3)[random.integers(3, size=count)] - 0.02
    wide = random.choice([0.04, 0.5], (count, 1))
    ends = np.concatenate([low, normal], axis=1), np.concatenate([low + side, normal + wide], axis=1)
    low, high = (end.astype(np.float32) for end in ends)
    return EdgeBoxes(np.nextafter(low, np.float32(-np.inf)), np.nextafter(high, np.float32(np.inf)))


def expected(boxes):
    """Return all pairs of boxes that overlap in the order of their level, (p, 2)."""
    meet = (boxes.low[:, None] <= boxes.high) & (boxes.low[None] <= boxes.high[:, None])
    first, second = np.nonzero(meet.all(axis=2))
    level = boxes.level
    once = (level[first] < level[second]) | ((level[first] == level[second]) & (first < second))
    first, second = first[once], second[once]
    order = np.lexsort([second, first, level[second]])
    return np.stack([first[order], second[order]], axis=1)


def pairs_of(neighbours, boxes):
    """Return all pairs that are found, (p, 2)."""
    found = [np.zeros((0, 2), np.int64), *(np.stack(some, axis=1) for some in neighbours.overlapping(boxes))]
    return np.concatenate(found)


@pytest.mark.parametrize(("origin", "spread"), [(0, 1), (0, 1e-3), (-977.3, 3), (1e5, 5)])
@pytest.mark.parametrize(("seed", "count"), [(0, 1), (1, 2), (2, 67), (3, 331)])
def test_all_pairs_are_found_once_and_in_order(compute, seed, count, origin, spread):
    boxes = random_boxes(seed, count, origin, spread)
    pairs = expected(boxes)
    assert count < 331 or len(pairs) > 10
    for neighbours in (HostNeighbours(), DeviceNeighbours(compute)):
        np.testing.assert_array_equal(pairs_of(neighbours, boxes), pairs)


def crowd(count):
    """Return boxes that all overlap."""
    boxes = random_boxes(5, count, spread=1e-6)
    return EdgeBoxes(boxes.low - 1, boxes.high + 1)


def test_host_yields_parts_of_limited_size(monkeypatch):
    """Each box of a crowd is in up to eight cubes with all others; a part has whole boxes."""
    monkeypatch.setattr(host_edge_neighbours, "_CHUNK", 1009)
    parts = list(HostNeighbours().overlapping(crowd(83)))
    assert len(parts) > 7 and max(len(first) for first, _ in parts) <= 1009
    np.testing.assert_array_equal(pairs_of(HostNeighbours(), crowd(83)), expected(crowd(83)))


@pytest.mark.parametrize("of_each", [1, 3])
def test_device_yields_parts_that_there_is_room_for(compute, monkeypatch, of_each):
    """There is room for no more pairs than one box has, or for a few times as many."""
    monkeypatch.setattr(device_edge_neighbours, "_OF_EACH", of_each)
    monkeypatch.setattr(device_edge_neighbours, "_LEAST", 1)
    parts = list(DeviceNeighbours(compute).overlapping(crowd(83)))
    assert len(parts) > 83 // 2 // of_each and max(len(first) for first, _ in parts) <= 83 * of_each
    np.testing.assert_array_equal(pairs_of(DeviceNeighbours(compute), crowd(83)), expected(crowd(83)))


def test_memory_for_pairs_has_a_limit(compute, monkeypatch):
    """A crowd of 3,001 boxes has 4.5 million pairs, of which 2^16 are on the device at a time."""
    sizes, room_for = [], SideQueue.room_for
    monkeypatch.setattr(
        SideQueue, "room_for", lambda beside, size: sizes.append(size) or room_for(beside, size)
    )
    total = sum(len(first) for first, _ in DeviceNeighbours(compute).overlapping(crowd(3001)))
    assert total == 3001 * 3000 // 2
    assert sizes == [8 << 16]


def test_no_boxes(compute):
    none = EdgeBoxes(np.zeros((0, 6), np.float32), np.zeros((0, 6), np.float32))
    for neighbours in (HostNeighbours(), DeviceNeighbours(compute)):
        assert not len(pairs_of(neighbours, none))


def test_sides_of_a_hard_edge_need_not_be_compared():
    """Edges of a facet meet at its corners, those of two facets lie on each other."""
    smooth, hard = (chart_edges(joined(cylinder(13, smooth)), 1, R) for smooth in (True, False))
    first, second = pairs_of(HostNeighbours(), edge_boxes(hard)).T
    np.testing.assert_allclose(hard.normals[first], hard.normals[second], atol=1e-6)
    assert len(first) < len(pairs_of(HostNeighbours(), edge_boxes(smooth)))


@pytest.mark.parametrize("distance", [0, 1e4])
def test_seams_are_the_same_to_the_bit(compute, distance):
    parts = [
        tile((0, 0), (4, 1), (2, 2, 40, 10)), tile((-0.7, 1), (1.9, 1), (2, 20, 19, 10)),
        tile((1.2, 1), (1.1, 1), (25, 20, 11, 10)), tile((2.3, 1), (9, 3), (2, 33, 45, 15), atlas=1),
        cylinder(17),
    ]  # fmt: skip
    triangles = joined(*((positions + distance, *others) for positions, *others in parts))
    host, device = (display_seams(triangles, 2, R, find) for find in (None, DeviceNeighbours(compute)))
    assert len(host)
    for name in ("atlas", "texel", "weight"):
        np.testing.assert_array_equal(getattr(device, name), getattr(host, name))
