"""Light of a lightmap fitted to vertices: exact for linear light, the least-squares solution for others."""

import numpy as np
import pytest

from engine.vertex_light.surface_integrals import integrate, look_up
from engine.vertex_light.vertex_fit import MassMatrix, corner_values, fit_vertices

RANDOM = np.random.default_rng(38)


def grid_mesh(columns, rows, jitter=0.3):
    """Return UVs of triangles over most of the unit square, areas and values, with displaced vertices."""
    x, y = np.meshgrid(np.linspace(0.07, 0.91, columns + 1), np.linspace(0.05, 0.95, rows + 1), indexing="ij")
    points = np.stack([x, y], axis=-1)
    points[1:-1, 1:-1] += RANDOM.uniform(-jitter, jitter, (columns - 1, rows - 1, 2)) / (columns, rows) / 2
    number = np.arange((columns + 1) * (rows + 1)).reshape(columns + 1, rows + 1)
    low, right, up, far = number[:-1, :-1], number[1:, :-1], number[:-1, 1:], number[1:, 1:]
    values = np.concatenate([np.stack([low, right, far], -1), np.stack([low, far, up], -1)]).reshape(-1, 3)
    uvs = points.reshape(-1, 2)[values].astype(np.float32)
    return uvs, areas_of(uvs), values, points.reshape(-1, 2)


def areas_of(uvs):
    edges = uvs[:, 1:].astype(np.float64) - uvs[:, :1]
    return np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]) / 2


def linear_lightmap(width, height):
    """Return a lightmap of 2 + 3u - v, 5u, 1 + v at its texels, and the function."""

    def light(uvs):
        u, v = uvs[..., 0], uvs[..., 1]
        return np.stack([2 + 3 * u - v, 5 * u, 1 + v], axis=-1)

    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    return light(np.stack([u, v], -1)).astype(np.float32), light


@pytest.mark.parametrize("size", [(37, 53), (7, 11)])
def test_linear_light_is_reproduced_exactly(size):
    lightmap, light = linear_lightmap(*size)
    # Within half a texel of the border, the light of a lightmap is constant.
    uvs, areas, values, points = grid_mesh(5, 3)
    uvs, points = 0.1 + 0.8 * uvs, 0.1 + 0.8 * points
    found = fit_vertices(lightmap, uvs, areas, values, len(points))
    assert found.light == pytest.approx(light(points), abs=2e-5)
    assert found.error < 1e-6


@pytest.mark.parametrize("level", [0.0, 1.0, 1e4, 1e-6])
def test_constant_light_is_constant(level):
    uvs, areas, values, points = grid_mesh(4, 7)
    found = fit_vertices(np.full((16, 16, 3), level, np.float32), uvs, areas, values, len(points))
    assert found.light == pytest.approx(np.full((len(points), 3), level), rel=1e-6)
    assert found.error < 1e-6


def test_the_solution_is_that_of_a_dense_solver():
    uvs, areas, values, points = grid_mesh(6, 5)
    lightmap = 1 + RANDOM.random((64, 48, 3)).astype(np.float32)
    found = fit_vertices(lightmap, uvs, areas, values, len(points))
    share = areas / areas.sum()
    mass = np.zeros((len(points), len(points)))
    for corners, area in zip(values, share, strict=True):
        mass[np.ix_(corners, corners)] += area / 12 * (1 + np.eye(3))
    weighted = integrate(lightmap, uvs, share).weighted
    right = np.zeros((len(points), 3))
    np.add.at(right, values, weighted)
    assert found.light == pytest.approx(np.linalg.solve(mass, right), rel=1e-5)
    unit = RANDOM.random(len(points))
    assert MassMatrix(values, share, len(points)).times(unit) == pytest.approx(mass @ unit)


def test_the_error_is_the_root_mean_square_over_the_surface():
    lightmap = np.zeros((32, 32, 3), np.float32)
    lightmap[:, 16:] = 2.0
    uvs = np.array([[[0.1, 0.1], [0.9, 0.1], [0.9, 0.9]], [[0.1, 0.1], [0.9, 0.9], [0.1, 0.9]]], np.float32)
    values = np.array([[0, 1, 2], [0, 2, 3]])
    found = fit_vertices(lightmap, uvs, areas_of(uvs), values, 4)
    weights = RANDOM.dirichlet((1, 1, 1), (2, 40_000))
    fitted = weights @ found.light[values].astype(np.float64)
    light = look_up(lightmap, weights @ uvs.astype(np.float64))
    assert found.error == pytest.approx(np.sqrt(np.square(fitted - light).mean()) / light.mean(), rel=0.02)
    assert found.light.min() >= 0 and 0.3 < found.error < 1


def test_light_next_to_darkness_does_not_become_negative():
    uvs, areas, values, points = grid_mesh(5, 5, jitter=0)
    lightmap = np.zeros((64, 64, 3), np.float32)
    lightmap[20:25, 30:40] = 50.0
    found = fit_vertices(lightmap, uvs, areas, values, len(points))
    assert (found.light >= 0).all() and found.light.max() > 1


def test_large_and_thin_triangles_are_integrated():
    """The integral of light over a triangle is that over its parts."""
    lightmap = RANDOM.random((97, 83, 3)).astype(np.float32)
    whole = np.array(
        [[[0.05, 0.1], [0.95, 0.2], [0.3, 0.9]], [[0.1, 0.5], [0.9, 0.51], [0.9, 0.5]]], np.float32
    )
    middle = whole.mean(axis=1, keepdims=True)
    parts = np.concatenate([np.concatenate([whole[:, [k, (k + 1) % 3]], middle], 1) for k in range(3)])
    found = integrate(lightmap, whole, areas_of(whole)).weighted.sum(axis=(0, 1))
    assert found == pytest.approx(
        integrate(lightmap, parts, areas_of(parts)).weighted.sum(axis=(0, 1)), rel=2e-3
    )


def test_zero_area_triangles_get_the_light_at_their_corners():
    lightmap, light = linear_lightmap(31, 31)
    uvs, areas, values, points = grid_mesh(2, 2)
    flat = np.array([[[0.4, 0.4], [0.5, 0.5], [0.6, 0.6]]], np.float32)
    uvs, areas = np.concatenate([uvs, flat]), np.append(areas, 0)
    values = np.concatenate([values, [[0, len(points), len(points) + 1]]])
    found = fit_vertices(lightmap, uvs, areas, values, len(points) + 3)
    assert found.light[: len(points)] == pytest.approx(light(points), abs=0.15)
    assert found.light[len(points) : -1] == pytest.approx(light(flat[0, 1:]), abs=1e-5)
    assert not found.light[-1].any() and found.error < 0.05


def test_a_mesh_without_triangles_or_area_is_no_error():
    lightmap = np.ones((4, 4, 3), np.float32)
    none = np.zeros((0, 3, 2), np.float32)
    assert fit_vertices(lightmap, none, np.zeros(0), np.zeros((0, 3), int), 2).light.shape == (2, 3)
    flat = fit_vertices(lightmap, np.full((1, 3, 2), 0.5, np.float32), np.zeros(1), np.array([[0, 1, 2]]), 3)
    assert flat.light == pytest.approx(np.ones((3, 3))) and flat.error == 0


def test_corners_share_a_value_by_vertex_and_normal():
    vertices = np.array([0, 0, 0, 7, 7, 1 << 30])
    up, side = [0, 0, 1], [1, 0, 0]
    normals = np.array([up, side, up, up, up, up], np.float32)
    normals[4, 0] = 2e-5
    found = corner_values(vertices, normals)
    assert found[0] == found[2] != found[1] and found[3] == found[4]
    assert sorted(set(found.tolist())) == [0, 1, 2, 3]
    assert len(corner_values(np.zeros(0, int), np.zeros((0, 3)))) == 0
