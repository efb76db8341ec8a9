"""Covered parts of texels that triangles do not fill."""

import numpy as np
import pytest

from engine.patches.texel_clip import clip_at_texels, clipped_centroids, fan_areas
from engine.patches.texel_fragments import TexelClipper
from engine.scene.triangles import Triangles

RESOLUTION = 13


def triangles_of(uvs, atlas=None):
    """Return triangles with lightmap UVs, (t, 3, 2), in the plane z = 0."""
    count = len(uvs)
    positions = np.concatenate([uvs, np.zeros((count, 3, 1))], axis=2).astype(np.float32)
    zeros, normals = np.zeros(count, np.int32), np.zeros((count, 3, 3), np.float32)
    atlas = zeros if atlas is None else np.asarray(atlas, np.int32)
    return Triangles(positions, normals, uvs.astype(np.float32), zeros, zeros, atlas)


def all_areas(triangles):
    """Return the area that each triangle covers of each texel, (t, r * r), by clipping at all of them."""
    texels = np.stack(np.divmod(np.arange(RESOLUTION**2), RESOLUTION)[::-1], axis=1)
    corners = triangles.uvs.astype(np.float64) * RESOLUTION
    return np.stack(
        [
            fan_areas(clip_at_texels(np.repeat(corner[None], len(texels), axis=0), texels)[:, :, :2]).sum(
                axis=1
            )
            for corner in corners
        ]
    )


def everywhere(atlases):
    """Return all texels."""
    return np.ones((atlases, RESOLUTION, RESOLUTION), bool)


def nasty_uvs():
    """Return random triangles, slivers, ones smaller than a texel, on texel borders, and beyond the map."""
    rng = np.random.default_rng(11)
    wide = rng.random((40, 3, 2))
    small = rng.random((40, 1, 2)) + (rng.random((40, 3, 2)) - 0.5) * 0.3 / RESOLUTION
    slivers = np.concatenate([rng.random((20, 2, 2)), np.zeros((20, 1, 2))], axis=1)
    slivers[:, 2] = slivers[:, 0] + 1e-4
    aligned = np.array([[(2, 3), (7, 3), (7, 9)], [(2, 3), (7, 9), (2, 9)], [(0, 0), (13, 0), (0, 13)]]) / 13
    beyond = rng.random((10, 3, 2)) * 3 - 1
    return np.concatenate([wide, small, slivers, aligned, beyond])


def test_pieces_are_all_texels_that_are_partly_covered(compute):
    triangles = triangles_of(nasty_uvs())
    areas = all_areas(triangles)
    pieces = TexelClipper(compute, triangles, RESOLUTION).border_pieces(everywhere(1))
    found = np.zeros_like(areas)
    np.add.at(found, (pieces.triangle, pieces.texel), pieces.area)
    partly = (areas > 1e-6) & (areas < 1 - 1e-6)
    assert partly.sum() > 1000
    assert found[partly] == pytest.approx(areas[partly], abs=1e-6)
    assert (found[~partly] < 1e-6).sum() + (found[~partly] > 1 - 1e-5).sum() == (~partly).sum()
    assert len(np.unique(pieces.triangle.astype(np.int64) * RESOLUTION**2 + pieces.texel)) == len(
        pieces.texel
    )


def test_points_lie_in_their_texel_and_are_even_on_what_is_covered(compute):
    triangles = triangles_of(nasty_uvs())
    clipper = TexelClipper(compute, triangles, RESOLUTION)
    pieces = clipper.border_pieces(everywhere(1))
    pieces = pieces.subset(pieces.area > 1e-3)
    found, side = clipper.points_in_texels(pieces, np.arange(len(pieces)), 20), 20
    keys, points = pieces.triangle.astype(np.int64) * RESOLUTION**2 + pieces.texel, found.barycentric
    order = np.argsort(keys)
    place = found.triangle.astype(np.int64) * RESOLUTION**2 + found.texel
    piece = order[np.searchsorted(keys, place, sorter=order)]
    assert (np.diff(piece) >= 0).all()
    count = np.bincount(piece, minlength=len(pieces))
    assert (count >= 0.75 * side**2).all() and (count <= side**2).all()
    assert points.min() >= 0 and np.abs(points.sum(axis=1) - 1).max() < 1e-5
    row, column = np.divmod(pieces.texel, RESOLUTION)
    corners = triangles.uvs[pieces.triangle].astype(float) * RESOLUTION
    corners -= np.stack([column, row], axis=1)[:, None]
    at = np.einsum("pw,pwd->pd", points, corners[piece])
    assert at.min() > -1e-4 and at.max() < 1 + 1e-4
    centroid = clipped_centroids(corners, np.zeros((len(pieces), 2), int))
    middle = np.einsum("mw,mwd->md", centroid, corners)
    mean = np.stack([np.bincount(piece, axis) for axis in at.T], axis=1) / count[:, None]
    assert np.abs(mean - middle).max() < 0.02
    assert np.abs(found.position - np.stack([column, row], axis=1)[piece] - at).max() < 2e-4
    assert np.bincount(piece, found.weight) == pytest.approx(pieces.area, abs=0.02)


def test_pieces_are_those_of_wanted_texels(compute):
    triangles = triangles_of(nasty_uvs())
    wanted = np.random.default_rng(2).random((1, RESOLUTION, RESOLUTION)) < 0.3
    every = TexelClipper(compute, triangles, RESOLUTION).border_pieces(everywhere(1))
    some = TexelClipper(compute, triangles, RESOLUTION).border_pieces(wanted)
    here = wanted.ravel()[every.texel]
    assert 0 < here.sum() < len(every)
    for name in ("atlas", "texel", "triangle", "area"):
        assert np.array_equal(getattr(some, name), getattr(every, name)[here])


def test_pieces_fill_the_texels_of_an_axis_aligned_square(compute):
    triangles = triangles_of(nasty_uvs()[100:102])
    pieces = TexelClipper(compute, triangles, RESOLUTION).border_pieces(everywhere(1))
    covered = np.bincount(pieces.texel, pieces.area, RESOLUTION**2)
    assert covered[covered > 0] == pytest.approx(1)
    assert len(pieces.texel) <= 2 * (covered > 0).sum()


def test_atlases_of_occluders_have_no_pieces_and_nothing_gives_nothing(compute):
    triangles = triangles_of(nasty_uvs()[:7], [0, 1, 2, 0, 1, 2, 0])
    clipper = TexelClipper(compute, triangles, RESOLUTION)
    pieces = clipper.border_pieces(everywhere(2))
    assert set(pieces.atlas) == {0, 1} and set(pieces.triangle) == {0, 1, 3, 4, 6}
    assert len(clipper.pieces_at(np.zeros(0, np.int32), np.zeros(0, np.int32)).area) == 0
