"""Rays of compute shaders meet what a comparison with every triangle finds, as those of OpenCL do."""

import numpy as np
import pytest

from engine.visibility.rays.shaders.host_bvh import build_host_bvh
from engine.visibility.rays.shaders.shader_tracer import ShaderTracer
from tests.gpu.test_rays import SOLID, SOUPS, alone, nearest_of_all, rays_for


@pytest.mark.parametrize("soup", SOUPS)
def test_the_nearest_triangle_is_found(graphics, soup):
    """Neither farther than triangles a little smaller are, nor nearer than ones a little larger."""
    joined = alone(SOUPS[soup]().astype(np.float32))
    rays, triangles = ShaderTracer(graphics, joined, SOLID), joined.positions
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


@pytest.mark.parametrize("count", [0, 1, 4, 5, 7, 1009])
def test_every_triangle_is_in_one_leaf_and_in_the_boxes_above(count):
    triangles = np.random.default_rng(count).normal(size=(count, 3, 3)).astype(np.float32) + 100
    bvh = build_host_bvh(triangles)
    floats, codes = bvh.nodes.view(np.float32), bvh.nodes.view(np.int32)
    found, depth = [], 0
    level = [(0, np.full(3, -np.inf), np.full(3, np.inf))]
    while level:
        depth, below = depth + 1, []
        for node, low, high in level:
            for child in (0, 2):
                code, inner_low, inner_high = codes[node, child, 3], *floats[node, child : child + 2, :3]
                leaf = range(~code >> 3, (~code >> 3) + (~code & 7))
                if code < 0 and not len(leaf):
                    continue
                assert (inner_low >= low).all() and (inner_high <= high).all()
                if code >= 0:
                    below.append((code, inner_low, inner_high))
                    continue
                numbers = bvh.triangles[leaf.start : leaf.stop, 0, 3]
                assert (triangles[numbers] >= inner_low).all() and (triangles[numbers] <= inner_high).all()
                found += list(numbers)
        level = below
    assert sorted(found) == list(range(count))
    assert depth == bvh.depth


def test_a_scene_without_triangles_hides_nothing(graphics):
    nothing = alone(np.zeros((1, 3, 3), np.float32))
    rays = ShaderTracer(graphics, nothing, SOLID)
    hit, _, _ = rays.cast(np.full((3, 3), 2.0), np.eye(3))
    assert (hit == -1).all()
    assert (rays.transmittance(np.full((3, 3), 2.0), -np.eye(3), np.inf) == 1).all()
