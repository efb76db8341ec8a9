"""Seams between charts: of one object and of two, whole edges and parts of them, and what is no seam."""

import time

import numpy as np
import pytest

from engine.patches.chart_edges import chart_edges
from engine.scene.triangles import Triangles
from tests.seams import find_seams

R = 64


def joined(*parts):
    """Return the triangles of several parts, each (positions, normals, uvs, atlas), as several meshes."""
    positions, normals, uvs = (
        np.concatenate([part[k] for part in parts]).astype(np.float32) for k in range(3)
    )
    counts = [len(part[0]) for part in parts]
    atlas = np.repeat(np.array([part[3] for part in parts], np.int32), counts)
    mesh = np.repeat(np.arange(len(parts), dtype=np.int32), counts)
    return Triangles(positions, normals, uvs, np.zeros(len(mesh), np.int32), mesh, atlas)


def tile(corner, size, chart, atlas=0, height=0.0, turned=False):
    """Return a rectangle in the plane z = height with its chart (x, y, width, height in texels)."""
    (x, y), (w, h) = corner, size
    world = np.array([(x, y, height), (x + w, y, height), (x + w, y + h, height), (x, y + h, height)])
    u, v, du, dv = chart
    uv = np.array([(u, v), (u + du, v), (u + du, v + dv), (u, v + dv)]) / R
    if turned:
        uv = np.roll(uv, 1, axis=0)
    split = np.array([[0, 1, 2], [0, 2, 3]])
    normals = np.broadcast_to([0.0, 0.0, 1.0], (2, 3, 3))
    return world[split], normals, uv[split], atlas


def world_of(triangles, atlas, texel):
    """Return where points of a lightmap, (p, 2) texels, are in the world, (p, 3): all triangles are tried."""
    corners = triangles.uvs.astype(np.float64) * R
    result = np.full((len(texel), 3), np.nan)
    for index, corner in enumerate(corners):
        basis = np.stack([corner[1] - corner[0], corner[2] - corner[0]], axis=1)
        weights = np.linalg.solve(basis, (texel - corner[0]).T).T
        weights = np.stack([1 - weights.sum(axis=1), *weights.T], axis=1)
        inside = (weights > -1e-4).all(axis=1) & (triangles.atlas[index] == atlas)
        result[inside] = weights[inside] @ triangles.positions[index].astype(np.float64)
    return result


def apart(triangles, seams):
    """Return the largest distance in the world between two points of a pair."""
    sides = [world_of(triangles, seams.atlas[:, k], seams.texel[:, k]) for k in (0, 1)]
    return np.abs(sides[0] - sides[1]).max()


def cylinder(n, smooth=True):
    """Return an open cylinder of n quads about z, unwrapped flat: one seam, at angle 0."""
    angle = np.linspace(0, 2 * np.pi, n + 1)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ring[-1] = ring[0]
    positions, normals, uvs = [], [], []
    for k in range(n):
        quad = np.array([(*ring[k], 0), (*ring[k + 1], 0), (*ring[k + 1], 2), (*ring[k], 2)])
        middle = np.append(ring[k] + ring[k + 1], 0) / np.linalg.norm(ring[k] + ring[k + 1])
        normal = quad * (1, 1, 0) if smooth else np.broadcast_to(middle, (4, 3))
        u, v = 4 + np.array([k, k + 1, k + 1, k]) * 40 / n, 4 + np.array([0, 0, 1, 1]) * 13
        uv = np.stack([u, v], axis=1) / R
        for split in ([0, 1, 2], [0, 2, 3]):
            for values, array in ((positions, quad), (normals, normal), (uvs, uv)):
                values.append(array[split])
    return np.array(positions), np.array(normals), np.array(uvs), 0


def test_cut_of_a_smooth_cylinder_is_its_only_seam():
    triangles = joined(cylinder(17))
    seams = find_seams(triangles, 1, R)
    assert seams.weight.sum() == pytest.approx(13, abs=0.01)
    np.testing.assert_allclose(np.sort(seams.texel[:, :, 0], axis=1), [[4, 44]] * len(seams), atol=1e-4)
    np.testing.assert_allclose(seams.texel[:, 0, 1], seams.texel[:, 1, 1], atol=1e-4)


def test_hard_edge_is_no_seam():
    assert not len(find_seams(joined(cylinder(6, smooth=False)), 1, R))


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("atlas", [0, 1])
def test_two_tiles_that_touch_have_a_seam_in_one_atlas_or_in_two(atlas, turned):
    other = tile((2, 0), (1.5, 2), (40, 7, 11, 17), atlas, turned=turned)
    triangles = joined(tile((0, 0), (2, 2), (3, 5, 20, 20)), other)
    seams = find_seams(triangles, 2, R)
    assert seams.weight.sum() == pytest.approx(20, rel=1e-3)
    assert apart(triangles, seams) < 1e-5
    assert {0, atlas} == set(seams.atlas.ravel())


def test_tiles_of_different_size_meet_in_part_of_their_edges():
    triangles = joined(
        tile((0, 0), (4, 1), (2, 2, 40, 10)),
        tile((-0.7, 1), (1.9, 1), (2, 20, 19, 10)),
        tile((1.2, 1), (1.1, 1), (25, 20, 11, 10)),
        tile((2.3, 1), (9, 3), (2, 33, 45, 15)),
    )
    seams = find_seams(triangles, 1, R)
    assert apart(triangles, seams) < 1e-5
    # 1.2, 1.1 and 1.7 m of the long edge at ten texels a metre, and the borders between the others.
    assert seams.weight.sum() == pytest.approx(12 + 11 + 17 + 10 + 10, rel=1e-3)


@pytest.mark.parametrize(("gap", "found"), [(1e-4, True), (0.01, False)])
def test_tiles_touch_if_less_than_a_fraction_of_a_texel_is_between(gap, found):
    triangles = joined(tile((0, 0), (1, 1), (2, 2, 20, 20)), tile((1 + gap, 0), (1, 1), (30, 2, 20, 20)))
    assert bool(len(find_seams(triangles, 1, R))) == found


@pytest.mark.parametrize("distance", [1e3, 1e5])
def test_seams_far_from_the_origin(distance):
    near = joined(tile((0, 0), (2, 2), (3, 5, 20, 20)), tile((2, 0.31), (1.3, 1.1), (40, 7, 13, 11)))
    moved = near.positions.astype(np.float64) + distance * np.array([1, -1.0, 0.5])
    far = Triangles(moved.astype(np.float32), near.normals, near.uvs, near.material, near.mesh, near.atlas)
    expected, found = (find_seams(triangles, 1, R) for triangles in (near, far))
    assert found.weight.sum() == pytest.approx(expected.weight.sum(), rel=0.05)


def test_tiles_at_another_height_or_turned_over_are_apart():
    below = tile((1, 0), (1, 1), (30, 2, 20, 20), height=-0.1)
    over = tile((1, 0), (1, 1), (30, 30, 20, 20))
    over = (over[0][:, ::-1], -over[1], over[2][:, ::-1], 0)
    triangles = joined(tile((0, 0), (1, 1), (2, 2, 20, 20)), below, over)
    assert not len(find_seams(triangles, 1, R))


def test_every_two_sheets_at_a_common_edge_are_compared():
    left, right = tile((0, 0), (1, 1), (2, 2, 9, 9)), tile((1, 0), (1, 1), (12, 2, 9, 9))
    wall = tile((1, 0), (1, 1), (22, 2, 9, 9))
    upright = wall[0][..., [2, 1, 0]] * (1, 1, 1) + (1, 0, -1)
    wall = (upright, np.broadcast_to([1.0, 0, 0], (2, 3, 3)), wall[2], 0)
    twin = (left[0], left[1], left[2] + np.float32(30 / R), 0)
    triangles = joined(wall, left, right, twin)
    seams = find_seams(triangles, 1, R)
    assert apart(triangles, seams) < 1e-5
    # Right meets left and its twin, which lie on each other: 2 x 9 texels, and 4 x 9 of their outlines.
    assert seams.weight.sum() == pytest.approx(6 * 9, rel=1e-3)


def test_triangles_without_area_and_occluders_have_no_seams():
    left, right = tile((0, 0), (1, 1), (2, 2, 9, 9)), tile((1, 0), (1, 1), (12, 2, 9, 9), atlas=1)
    point = (np.full((1, 3, 3), 1.0), left[1][:1], left[2][:1], 0)
    line = (left[0][:1], left[1][:1], np.full((1, 3, 2), 0.5), 0)
    assert not len(find_seams(joined(left, right, point, line), 1, R))
    assert not len(find_seams(joined(line), 1, R))


def test_chart_without_holes_has_no_edges_inside():
    edges = chart_edges(joined(cylinder(11)), 1, R)
    assert len(edges) == 2 * 11 + 2


@pytest.mark.parametrize("seed", range(4))
def test_cuts_of_a_sheet_at_random_are_found_whole(seed):
    """A sheet of prime size is cut into strips that lie anywhere on the lightmap, turned and scaled."""
    random, n = np.random.default_rng(seed), 7
    cuts = np.sort(random.uniform(0.3, 5.7, 4))
    strips = list(zip([0, *cuts], [*cuts, 6], strict=True))
    parts = [
        tile((start, 0), (end - start, n), (2 + 12 * k, 3, random.uniform(3, 9), 29), turned=bool(k % 2))
        for k, (start, end) in enumerate(strips)
    ]
    triangles = joined(*parts)
    seams = find_seams(triangles, 1, R)
    assert apart(triangles, seams) < 1e-4
    points = np.concatenate([world_of(triangles, 0, seams.texel[:, k])[:, 0] for k in (0, 1)])
    assert np.abs(points[:, None] - cuts).min(axis=1).max() < 1e-4
    assert len(np.unique(np.round(points, 3))) == len(cuts)


def test_a_million_triangles_take_less_than_seconds():
    n = 700
    u, v = np.meshgrid(*[np.linspace(0, 1, n + 1)] * 2, indexing="ij")
    world = np.stack([np.cos(2 * np.pi * u), np.sin(2 * np.pi * u), v], axis=2)
    world[-1] = world[0]
    uv = np.stack([u, v], axis=2) * 0.9 + 0.05
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]

    def triangles_of(grid):
        quad = np.stack([grid[i : n + i, j : n + j].reshape(n * n, -1) for i, j in corners], axis=1)
        return quad[:, [[0, 1, 2], [0, 2, 3]]].reshape(2 * n * n, 3, -1)

    mesh = joined((triangles_of(world), triangles_of(world * (1, 1, 0)), triangles_of(uv), 0))
    started = time.process_time()
    seams = find_seams(mesh, 1, 1024)
    assert time.process_time() - started < 4
    assert seams.weight.sum() == pytest.approx(0.9 * 1024, rel=1e-3)
