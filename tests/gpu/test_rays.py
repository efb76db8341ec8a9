"""Rays meet what a comparison with every triangle finds, whatever the triangles and the hierarchy's shape."""

from types import SimpleNamespace

import numpy as np
import pyopencl as cl
import pytest

from engine.scene.model import Mesh, Scene
from engine.scene.triangles import join_meshes
from engine.visibility.rays import bvh
from engine.visibility.rays.bvh import BvhLayout
from engine.visibility.rays.ray_tracer import RayTracer
from engine.visibility.rays.upper_levels import UpperLevels

SOLID = SimpleNamespace(needed=False)
SHAPES = [BvhLayout(8, 8, 8, 0.5), BvhLayout(2, 1, 4, 0.35), BvhLayout(4, 4, 8, 0.5)]


def alone(positions):
    """Return triangles of which only positions matter, as the bake joins them."""
    numbers = np.zeros(len(positions), np.int32)
    mesh = Mesh("Soup", positions, positions, positions[..., :2], numbers, numbers, numbers)
    return join_meshes(Scene((mesh,), ()))


def random(count, size=0.5):
    generator = np.random.default_rng(count)
    return generator.random((count, 1, 3)) * 4 + generator.normal(size=(count, 3, 3)) * size


def needles(count):
    """Return long, thin triangles, among them lines and points."""
    triangles = random(count)
    triangles[:, 2] = triangles[:, 1] + (triangles[:, 2] - triangles[:, 1]) * 1e-2
    triangles[::7, 2] = triangles[::7, 1]
    triangles[::11] = triangles[::11, :1]
    return triangles * np.array([20, 1, 0.2])


def nested(count):
    """Return triangles one around the other, each a little larger: neighbours all want the smaller one."""
    corners = np.array([(0, 0, 1), (1, 0, -1), (0, 1, 0)])
    return corners * np.geomspace(1e-3, 1e3, count)[:, None, None]


SOUPS = {
    "one": lambda: random(1),
    "two": lambda: random(2),
    "few": lambda: random(7),
    "many": lambda: random(3000),
    "merged": lambda: random(20_000, 0.05),
    "same": lambda: np.repeat(random(1), 17_000, axis=0),
    "points": lambda: np.ones((20, 3, 3)),
    "needles": lambda: needles(500),
    "nested": lambda: nested(17_000),
    "flat": lambda: random(2000) * np.array([1, 1, 0]),
    "far": lambda: random(300) + 1000,
    "wide": lambda: np.concatenate([random(300), random(300) * 1e4]),
}


def rays_for(triangles, count):
    """Return rays from around triangles to points on them, then rays along the axes."""
    generator = np.random.default_rng(5)
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    origins = (
        low
        + (high - low) * generator.uniform(-0.2, 1.2, (count, 3))
        + generator.normal(size=(count, 3)) * 0.1
    )
    weights = generator.dirichlet(np.ones(3), count)
    chosen = generator.integers(0, len(triangles), count)
    directions = np.einsum("nk,nkd->nd", weights, triangles[chosen]) - origins
    directions[:9] = np.tile(np.eye(3), (3, 1))
    return origins, directions


def nearest_of_all(triangles, origins, directions, rim):
    """Return (rays,) float64: distance in lengths of the direction to triangles widened by a rim.

    Rounding decides whether those without an area are met: they count if the rim is wide.
    """
    corner, edge1 = triangles[:, 0], triangles[:, 1] - triangles[:, 0]
    edge2 = triangles[:, 2] - triangles[:, 0]
    has_area = np.cross(edge1, edge2).any(axis=1) | (rim > 0)
    nearest = np.full(len(origins), np.inf)
    with np.errstate(all="ignore"):
        for ray, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
            p, q = np.cross(direction, edge2), np.cross(origin - corner, edge1)
            determinant = (edge1 * p).sum(axis=1)
            u, v = ((origin - corner) * p).sum(axis=1) / determinant, q @ direction / determinant
            distance = (edge2 * q).sum(axis=1) / determinant
            met = (u >= -rim) & (v >= -rim) & (u + v <= 1 + rim) & (distance > 0) & has_area
            nearest[ray] = distance[met].min(initial=np.inf)
    return nearest


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: f"{shape.width} wide")
@pytest.mark.parametrize("soup", SOUPS)
def test_the_nearest_triangle_is_found(compute, monkeypatch, soup, shape):
    """Neither farther than triangles a little smaller are, nor nearer than ones a little larger."""
    monkeypatch.setattr(bvh, "shape_for", lambda compute: shape)
    joined = alone(SOUPS[soup]().astype(np.float32))
    rays, triangles = RayTracer(compute, joined, SOLID), joined.positions
    origins, directions = rays_for(triangles.astype(np.float64), 150)
    hit, _, distance = rays.cast(origins, directions)
    through = rays.transmittance(origins, directions, 0.5)
    bounds = [nearest_of_all(triangles.astype(np.float64), origins, directions, rim) for rim in (0.01, -0.01)]
    first, last = bounds[0] * 0.999, bounds[1] * 1.001
    assert ((hit < 0) == np.isinf(distance)).all()
    assert (first <= distance).all()
    assert (distance <= last).all()
    assert (through[first > 0.5] == 1).all()
    assert (through[last < 0.5] == 0).all()


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: f"{shape.width} wide")
def test_every_triangle_is_in_the_hierarchy_once(compute, shape):
    """Leaves name all triangles, and children lie within the boxes their parents keep of them."""
    triangles = random(40_000, 0.05).astype(np.float32)
    built = bvh.build_bvh(compute, triangles, 6.0, shape)
    assert_whole(compute, built, shape, len(triangles))


def test_builds_are_repeatable(compute):
    triangles = random(40_000, 0.05).astype(np.float32)
    built = [bvh.build_bvh(compute, triangles, 6.0) for _ in range(2)]
    nodes, packets = (
        [download(compute, getattr(one, name)) for one in built] for name in ("nodes", "triangles")
    )
    if not compute.processor:
        packets = [values.reshape(-1, 12)[:, :10] for values in packets]  # the last two only fill four floats
    for first, second in (nodes, packets):
        assert (first.view(np.int32) == second.view(np.int32)).all()


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: f"{shape.width} wide")
def test_a_tree_serves_where_its_triangles_move_a_little(compute, shape, monkeypatch):
    """A tree that has become bad, or that is of other triangles, is made anew."""
    made, build = [], UpperLevels.__init__
    monkeypatch.setattr(UpperLevels, "__init__", lambda *boxes: made.append(1) or build(*boxes))
    triangles = random(301, 0.2).astype(np.float32)
    first = bvh.build_bvh(compute, triangles, 6.0, shape)
    steps = np.zeros((301, 1, 3), np.float32)
    for distance, count, anew in ((0.05, 301, 0), (0.1, 301, 0), (5.0, 301, 1), (0.0, 300, 1)):
        made.clear()
        steps[:90] = distance
        moved = (triangles + steps)[:count]
        built = bvh.build_bvh(compute, moved, 12.0, shape, first.top)
        assert len(made) == anew
        assert_whole(compute, built, shape, count)


def assert_whole(compute, built, shape, count):
    """Leaves name all triangles once, and children lie within the boxes their parents keep of them."""
    nodes = download(compute, built.nodes).reshape(-1, 8, shape.width)
    children = nodes[:, 6].view(np.int32)
    leaves = ~children[(children < 0) & np.isfinite(nodes[:, 0])]
    record = 12 if shape.packet == 1 else 10
    packets = download(compute, built.triangles)
    packets = packets.reshape(-1, record) if shape.packet == 1 else packets.reshape(-1, record, shape.packet)
    numbers = packets[:, 9].view(np.int32)[packets[:, 3:9].any(axis=1)]
    assert sorted(numbers) == list(range(count))
    assert sorted(np.concatenate([(leaf >> 3) + np.arange(leaf & 7) for leaf in leaves])) == list(
        range(len(packets))
    )
    low, high = nodes[:, 0:6:2], nodes[:, 1:6:2]
    rounding = 0
    if shape.width == 2:
        low, high, rounding = low - high, low + high, 1e-5
    for parent, child in np.argwhere(children >= 0)[:1000]:
        inside = children[parent, child]
        kept = np.isfinite(high[inside, 0])
        assert np.abs(low[inside][:, kept].min(axis=1) - low[parent, :, child]).max() <= rounding
        assert np.abs(high[inside][:, kept].max(axis=1) - high[parent, :, child]).max() <= rounding


def download(compute, buffer):
    values = np.empty(buffer.size // 4, np.float32)
    cl.enqueue_copy(compute.queue, values, buffer)
    return values


def test_nothing_slips_between_triangles(compute):
    """Rays from the middle of a room to the edges and corners of its walls' triangles all meet something."""
    grid = np.linspace(-1, 1, 12)
    corner = np.stack(np.meshgrid(grid[:-1], grid[:-1], indexing="ij"), -1).reshape(-1, 2)
    step = grid[1] - grid[0]
    square = np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]]) * step
    flat = (corner[:, None, None] + square).reshape(-1, 3, 2)
    walls = [np.insert(flat, axis, side, axis=2) for axis in range(3) for side in (-1.0, 1.0)]
    triangles = (np.concatenate(walls) @ np.linalg.qr(random(1)[0])[0]).astype(np.float32)
    joined = alone(triangles)
    rays, triangles = RayTracer(compute, joined, SOLID), joined.positions
    weights = np.array([(0.5, 0.5, 0), (0, 0.3, 0.7), (0.9, 0, 0.1), (1, 0, 0)])
    targets = np.einsum("wk,tkd->wtd", weights, triangles).reshape(-1, 3)
    for origin in ((0, 0, 0), (0.3, -0.2, 0.4)):
        hit, _, distance = rays.cast(np.tile(origin, (len(targets), 1)), targets - origin)
        assert (hit >= 0).all()
        assert distance == pytest.approx(np.ones(len(targets)), abs=1e-4)
