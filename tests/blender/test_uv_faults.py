"""Unusable lightmap UVs are reported, usable ones are not."""

import numpy as np
import pytest

from engine import finished
from tests.blender.things import cross, part


def grid(n, seed=1, low=0.1, high=0.9):
    """Return the triangles of n x n crooked quads, (2 n^2, 3, 2) float32."""
    axis = np.linspace(low, high, n + 1)
    points = np.stack(np.meshgrid(axis, axis), axis=-1)
    shift = np.random.default_rng(seed).uniform(-0.3, 0.3, (n - 1, n - 1, 2))
    points[1:-1, 1:-1] += shift * (high - low) / n
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    halves = [np.stack(corners, axis=2).reshape(-1, 3, 2) for corners in ((a, b, c), (a, c, d))]
    return np.concatenate(halves).astype(np.float32)


@pytest.mark.parametrize("move", [(1, 0, 0), (1e-3, 0.3, 0.7), (3, -70, 50), (-1, 1, 1)])
@pytest.mark.parametrize("n", [2, 7, 53, 211])
def test_neighbours_do_not_overlap_and_copies_do(n, move):
    """Also in charts that are tiny, mirrored or outside the lightmap."""
    faults = part("operators.scene.uvs.uv_faults")
    scale, u, v = move
    uvs = (grid(n) * (scale, abs(scale)) + (u, v)).astype(np.float32)
    assert not faults.overlap(uvs)
    assert faults.overlap(np.concatenate([uvs, uvs[: max(1, len(uvs) // 50)]]))
    assert faults.overlap(np.concatenate([uvs, uvs[:, ::-1]]))


@pytest.mark.parametrize("extent", [0.02, 0.2, 1])
@pytest.mark.parametrize("count", [1, 3, 61])
def test_sorted_spans_cover_the_same_cells(monkeypatch, count, extent):
    faults, coverage = part("operators.scene.uvs.uv_faults"), part("operators.scene.uvs.coverage_grid")
    rng = np.random.default_rng(count)
    corners = (rng.random((count, 1, 2)) + rng.random((count, 3, 2)) * extent) / (1 + extent) * faults._GRID
    covered = faults._covered_cells(corners)
    low, width, height = (300, 100), faults._GRID - 301, faults._GRID - 109
    window = corners * (width / faults._GRID, height / faults._GRID)
    cells, doubled = finished(faults.find_covered(window, width, height))
    footprint = finished(coverage.make_footprint((window + low) / 512, 512))
    assert covered[0] > 0 and len(cells)
    monkeypatch.setattr(faults, "_FEW", -1)
    assert covered == faults._covered_cells(corners)
    counted, doubled_too = finished(faults.find_covered(window, width, height))
    np.testing.assert_array_equal(cells, counted)
    np.testing.assert_array_equal(footprint.covered, (cells // width + 100) * 512 + cells % width + 300)
    assert doubled == doubled_too == footprint.doubled


def test_slivers_points_and_nothing_do_not_overlap():
    faults = part("operators.scene.uvs.uv_faults")
    fan = np.array([[(0, 0), (1, y), (1, y + 1e-4)] for y in np.arange(0, 1, 1e-4)], np.float32)
    assert not faults.overlap(fan)
    assert not faults.overlap(np.full((5, 3, 2), 0.25, np.float32))
    assert not faults.overlap(np.zeros((0, 3, 2), np.float32))


def test_part_that_lies_on_another_is_found_wherever_it_is():
    faults = part("operators.scene.uvs.uv_faults")
    rng = np.random.default_rng(5)
    for _ in range(20):
        low = rng.uniform(0, 0.4, 2)
        patch = grid(3, low=0, high=0.3) + low.astype(np.float32)
        assert faults.overlap(np.concatenate([grid(31, low=0, high=1), patch]))
        assert not faults.overlap(np.concatenate([grid(31, low=0, high=1), patch + np.float32(1.5)]))


def test_overlaps_are_looked_for_once_and_again_where_uvs_are_others(monkeypatch):
    """Also in arrays that are changed in place; what was looked at long ago is forgotten."""
    faults = part("operators.scene.uvs.uv_faults")
    looked, found = [], faults._overlap
    monkeypatch.setattr(faults, "_overlap", lambda uvs: looked.append(len(uvs)) or found(uvs))
    monkeypatch.setattr(faults, "_overlapping", {})
    monkeypatch.setattr(faults, "_REMEMBERED", 3)
    uvs = grid(13, seed=8)
    assert not faults.overlap(uvs) and not faults.overlap(uvs.copy()) and len(looked) == 1
    uvs[: len(uvs) // 2] = uvs[len(uvs) // 2 :]
    assert faults.overlap(uvs) and faults.overlap(uvs[:]) and len(looked) == 2
    for seed in range(3):
        assert not faults.overlap(grid(13, seed=20 + seed))
    assert faults.overlap(uvs) and len(looked) == 6


def test_faces_without_texels_are_missed():
    faults = part("operators.scene.uvs.uv_faults")
    uvs = grid(10)
    positions = np.concatenate([uvs, np.zeros((len(uvs), 3, 1), np.float32)], axis=2)
    assert faults.cover(uvs, positions)
    uvs[::50] = uvs[::50, :1]
    assert not faults.cover(uvs, positions)
    assert not faults.cover(np.zeros_like(uvs), positions)


@pytest.mark.parametrize("resolution", [8, 33, 257])
def test_texels_of_triangles_are_those_whose_centres_they_hold(resolution):
    faults = part("operators.scene.uvs.uv_faults")
    uvs = np.random.default_rng(resolution).uniform(-0.2, 1.2, (30, 3, 2)).astype(np.float32)
    clipped = np.clip(uvs.astype(np.float64), 0, 1) * resolution
    centre = np.arange(resolution) + 0.5
    points = np.stack(np.meshgrid(centre, centre), axis=-1)
    expected = np.zeros((resolution, resolution), int)
    for a, b, c in clipped:
        sides = np.array([cross(q - p, points - p) for p, q in ((a, b), (b, c), (c, a))])
        expected += (sides > 0).all(axis=0) | (sides < 0).all(axis=0)
    found = np.zeros((resolution, resolution + 1), int)
    texels, count = faults.covered_texels(uvs, resolution)
    found.reshape(-1)[texels] = count
    assert (found[:, :-1] == expected).all() and not found[:, -1].any()
