"""The fit of texels to what their bilinear display shows: points, seams, bounds, and its linear algebra."""

from itertools import pairwise

import numpy as np
import pytest

from engine.patches.patch_list import PatchList
from engine.patches.seams import Seams
from engine.postprocess.bilinear import footprints
from engine.postprocess.bilinear_fit import BilinearFit
from engine.postprocess.bounded_cg import BoundedCg
from engine.postprocess.dilation import Dilation
from engine.postprocess.ell_matrix import EllMatrix
from engine.postprocess.lightmap_points import LightmapPoints, off_centre_patches
from engine.postprocess.texel_stencil import TexelStencil
from tests.seams import find_seams
from tests.unit.test_seams import R, cylinder, joined, tile, world_of

NO_SEAMS = Seams(np.zeros((0, 2), np.int32), np.zeros((0, 2, 2)), np.zeros(0))


def points_at(position, atlas=0, weight=1.0):
    """Return points of one atlas that stand for as much of a texel each."""
    position = np.asarray(position, float).reshape(-1, 2)
    return LightmapPoints(
        np.full(len(position), atlas, np.int32), position, np.full(len(position), float(weight))
    )


def centres(mask):
    """Return the centres of texels, mask (atlases, r, r) bool."""
    atlas, row, column = np.nonzero(mask)
    return LightmapPoints(atlas, np.stack([column, row], axis=1) + 0.5, np.ones(len(atlas)))


def shown(images, atlas, position):
    """Return the values of bilinear lookups, (p, c)."""
    texels, weights = footprints(np.broadcast_to(atlas, len(position)), position, images.shape[1])
    return np.einsum("pk,pkc->pc", weights, images.reshape(-1, images.shape[3])[texels])


def covered(triangles, atlases):
    """Return a mask of texels with centres on triangles, (atlases, R, R), and their world positions."""
    mask = np.ones((atlases, R, R), bool)
    every = centres(mask)
    world = np.full((len(every), 3), np.nan)
    for atlas in range(atlases):
        world[every.atlas == atlas] = world_of(triangles, atlas, every.position[every.atlas == atlas])
    on = np.isfinite(world).all(axis=1)
    return on.reshape(mask.shape), world[on]


def step(images, seams):
    """Return how much both sides of seams differ, on average."""
    return np.abs(
        shown(images, seams.atlas[:, 0], seams.texel[:, 0])
        - shown(images, seams.atlas[:, 1], seams.texel[:, 1])
    ).mean()


def dilated(images, known):
    """Return images whose unknown texels have the mean of known neighbours: what no seam knows of."""
    filled = images.copy()
    for image, mask in zip(filled, known, strict=True):
        Dilation(mask, 3).fill(image)
    return filled


def test_texels_with_nothing_but_their_centre_keep_its_bits():
    random = np.random.default_rng(0)
    mask = random.random((3, 13, 13)) < 0.4
    values = random.normal(size=(mask.sum(), 5)).astype(np.float32)
    fit = BilinearFit(13, 3, centres(mask), NO_SEAMS)
    images = fit.images(values)
    assert (fit.known == mask).all() and (images[~mask] == 0).all()
    assert (images[mask].view(np.uint32) == values.view(np.uint32)).all()


@pytest.mark.parametrize("second_atlas", [0, 1])
@pytest.mark.parametrize("turned", [False, True])
def test_step_between_two_tiles_falls_and_texels_inside_keep_their_bits(second_atlas, turned):
    first = tile((0, 0), (2, 2), (3.3, 5.1, 20.7, 21.3))
    triangles = joined(first, tile((2, 0.3), (1.5, 1.9), (36, 7.7, 17.9, 13.1), second_atlas, turned=turned))
    mask, world = covered(triangles, 2)
    light = np.stack([1 + np.sin(3 * world[:, 0] + 2 * world[:, 1]), np.exp(world[:, 0])], axis=1)
    seams = find_seams(triangles, 2, R)
    fit = BilinearFit(R, 2, centres(mask), seams)
    images = fit.images(light.astype(np.float32))
    raw = np.zeros_like(images)
    raw[mask] = light
    before = dilated(raw, mask)
    assert step(images, seams) < step(before, seams) / 10
    read = np.zeros(mask.size, bool)
    for side in (0, 1):
        texels, weights = footprints(seams.atlas[:, side], seams.texel[:, side], R)
        read[texels[weights > 0]] = True
    inside = mask & ~read.reshape(mask.shape)
    assert inside.sum() > 300 and (images[inside] == raw[inside]).all()
    changed = np.abs(images - raw)[mask & ~inside]
    assert changed.max() < 0.1 * light.max() and (changed > 0).any()


def test_light_around_a_smooth_cylinder_has_no_step_at_its_cut():
    triangles = joined(cylinder(17))
    mask, world = covered(triangles, 1)
    light = (2 + world[:, :1] + 1.5 * world[:, 1:2] * world[:, 2:]).astype(np.float32)
    seams = find_seams(triangles, 1, R)
    fit = BilinearFit(R, 1, centres(mask), seams)
    raw = np.zeros((1, R, R, 1), np.float32)
    raw[mask] = light
    images = fit.images(light)
    assert step(images, seams) < step(dilated(raw, mask), seams) / 10
    at_seam = world_of(triangles, 0, seams.texel[:, 0])
    truth = 2 + at_seam[:, :1] + 1.5 * at_seam[:, 1:2] * at_seam[:, 2:]
    before = np.abs(shown(dilated(raw, mask), 0, seams.texel[:, 0]) - truth).mean()
    assert np.abs(shown(images, 0, seams.texel[:, 0]) - truth).mean() < before / 2


def test_side_of_a_seam_that_nobody_knows_shows_what_the_other_one_does():
    triangles = joined(tile((0, 0), (2, 2), (3, 5, 20, 20)), tile((2, 0), (2, 2), (30, 5, 20, 20)))
    mask, world = covered(triangles, 1)
    mask[mask] = world[:, 0] < 2
    light = (1 + 0.2 * np.sin(5 * world[world[:, 0] < 2][:, 1:2])).astype(np.float32)
    seams = find_seams(triangles, 1, R)
    images = BilinearFit(R, 1, centres(mask), seams).images(light)
    assert step(images, seams) < 0.005
    np.testing.assert_allclose(images[mask], light, rtol=0.005)


def test_seam_both_of_whose_sides_nobody_knows_is_none():
    triangles = joined(tile((0, 0), (2, 2), (3, 5, 20, 20)), tile((2, 0), (2, 2), (30, 5, 20, 20)))
    mask, world = covered(triangles, 1)
    mask[mask] = np.abs(world[:, 0] - 2) > 0.3
    light = np.random.default_rng(1).random((mask.sum(), 1)).astype(np.float32)
    fit = BilinearFit(R, 1, centres(mask), find_seams(triangles, 1, R))
    assert (fit.known == mask).all() and (fit.images(light)[mask] == light).all()


def test_points_between_centres_give_the_texels_of_a_bilinear_image():
    random = np.random.default_rng(2)
    x, y = np.meshgrid(*[np.arange(11.0)] * 2)
    truth = (1 + 0.3 * x + 0.02 * (x - 4) * y**2)[None, :, :, None].astype(np.float32)
    position = random.uniform(0.5, 10.5, (4000, 2))
    fit = BilinearFit(11, 1, points_at(position, weight=121 / 4000), NO_SEAMS)
    images = fit.images(shown(truth, 0, position).astype(np.float32))
    assert fit.known.all()
    inside = np.s_[:, 1:-1, 1:-1]
    np.testing.assert_allclose(images[inside], truth[inside], atol=0.01 * np.ptp(truth))


def test_hard_shadow_is_nearer_than_with_means_and_does_not_ring():
    side = 33
    position = (np.stack(np.meshgrid(*[np.arange(side * 4)] * 2), axis=2).reshape(-1, 2) + 0.5) / 4
    lit = (position @ [0.83, 0.56] < 21.7).astype(np.float32)[:, None] * 1.4
    points = points_at(position, weight=1 / 16)
    images = BilinearFit(side, 1, points, NO_SEAMS).images(lit)
    means = np.bincount(points.texels(side), lit[:, 0]).reshape(1, side, side, 1) / 16
    assert images.min() >= 0 and images.max() <= 1.4
    error = [np.sqrt(np.mean((shown(image, 0, position) - lit) ** 2)) for image in (means, images)]
    assert error[1] < 0.97 * error[0]


def test_overshoot_stays_within_two_per_cent_of_the_light_around():
    """A bright spot far off does not widen the range at a shadow's edge."""
    side = 24
    position = (np.stack(np.meshgrid(*[np.arange(side * 4)] * 2), axis=2).reshape(-1, 2) + 0.5) / 4
    light = np.where(position[:, :1] < 11.3, 1.0, 3.0).astype(np.float32)
    light[(position > 22).all(axis=1)] = 50
    images = BilinearFit(side, 1, points_at(position, weight=1 / 16), NO_SEAMS).images(light)
    edge = images[0, :16]
    assert edge.min() == 1 and 3 < edge.max() <= 3.04 + 1e-6


@pytest.mark.parametrize("resolution", [8, 11, 17])
def test_charts_of_one_texel_show_their_point_wherever_they_are(resolution):
    random = np.random.default_rng(resolution)
    last = resolution - 1
    corner = np.array([(0, 0), (last, 0), (0, last), (last, last), (4, 3)])
    position = corner + random.uniform(0.05, 0.95, (5, 2))
    points = LightmapPoints(np.array([0, 1, 0, 1, 1]), position, np.full(5, 1e-3))
    light = random.uniform(1, 2, (5, 3)).astype(np.float32)
    images = BilinearFit(resolution, 2, points, NO_SEAMS).images(light)
    assert np.isfinite(images).all()
    for atlas, place, value in zip(points.atlas, position, light, strict=True):
        np.testing.assert_allclose(shown(images, atlas, place[None])[0], value, rtol=2e-3)


def test_no_points_give_black():
    fit = BilinearFit(9, 2, points_at([]), NO_SEAMS)
    assert not fit.known.any() and (fit.images(np.zeros((0, 3), np.float32)) == 0).all()


@pytest.mark.parametrize("seed", range(6))
def test_nasty_charts_stay_finite_and_within_their_light(seed):
    """Tiles without any gap, of odd places and sizes, partly hidden, up to the atlas's border."""
    random = np.random.default_rng(seed)
    cuts = np.r_[0, np.sort(random.uniform(0, R, 6)), R]
    parts = [
        tile((k * 2, 0), (2, random.uniform(0.5, 9)), (u, 0, v - u, R), turned=bool(random.integers(2)))
        for k, (u, v) in enumerate(pairwise(cuts))
        if v > u
    ]
    triangles = joined(*parts)
    mask, _ = covered(triangles, 1)
    mask &= random.random(mask.shape) < 0.7
    points = centres(mask)
    extra = points_at(random.uniform(0, R, (50, 2)), weight=0.3)
    points = LightmapPoints(
        *(np.concatenate([getattr(part, name) for part in (points, extra)])
          for name in ("atlas", "position", "weight"))
    )  # fmt: skip
    light = random.lognormal(0, 3, (len(points), 3)).astype(np.float32)
    images = BilinearFit(R, 1, points, find_seams(triangles, 1, R)).images(light)
    assert np.isfinite(images).all() and images.min() >= 0 and images.max() <= light.max()


def test_patches_are_points_at_centres_except_thin_ones():
    triangles = joined(tile((0, 0), (1, 1), (2, 2, 8, 8)))
    texel = np.array([3 * R + 5, 4 * R + 2], np.int32)
    weights = np.array([(0.5625, 0.1875, 0.25), (0.72, 0.0, 0.28)], np.float32)
    weights[0] = (1 - 3.5 / 8, 3.5 / 8 - 1.5 / 8, 1.5 / 8)
    patches = PatchList(R, np.zeros(2, np.int32), texel, np.array([0, 1], np.int32), weights)
    number, points = off_centre_patches(None, triangles, patches)
    np.testing.assert_array_equal(number, [1])
    corners = triangles.uvs[1].astype(float) * R
    np.testing.assert_allclose(points.position, [weights[1] @ corners], rtol=1e-6)


def test_stencil_and_rows_are_their_dense_matrices():
    random = np.random.default_rng(3)
    resolution = 6
    points = points_at(random.uniform(0, resolution, (40, 2)))
    texels, weights = footprints(points.atlas, points.position, resolution)
    dense = np.zeros((40, resolution**2))
    np.add.at(dense, (np.arange(40)[:, None], texels), weights)
    count, x = random.uniform(0.1, 2, 40), random.normal(size=resolution**2)
    stencil = TexelStencil(texels, weights, count, resolution**2)
    matrix = dense.T @ (count[:, None] * dense)
    np.testing.assert_allclose(stencil.times(x), matrix @ x, atol=1e-12)
    np.testing.assert_allclose(stencil.diagonal, np.diag(matrix), atol=1e-12)
    rows = EllMatrix(texels, weights, resolution**2)
    np.testing.assert_allclose(rows.times(x), dense.T @ (dense @ x), atol=1e-12)


def test_gradients_find_least_squares_and_keep_bounds():
    random = np.random.default_rng(4)
    columns = np.stack([np.sort(random.choice(23, 3, replace=False)) for _ in range(80)])
    entries, target = random.normal(size=(80, 3)), random.normal(size=80)
    dense = np.zeros((80, 23))
    np.put_along_axis(dense, columns, entries, axis=1)
    solver = BoundedCg([EllMatrix(columns, entries, 23)])
    right, start, far = dense.T @ target, np.zeros(23), np.full(23, 1e9)
    expected = np.linalg.lstsq(dense, target, rcond=None)[0]
    np.testing.assert_allclose(solver.solution(right, start, -far, far), expected, atol=1e-2)
    low, high = np.full(23, -0.1), np.full(23, 0.2)
    bounded = solver.solution(right, start, low, high)
    assert bounded.min() >= -0.1 and bounded.max() <= 0.2
    clipped = np.clip(expected, low, high)
    error = [np.linalg.norm(dense @ x - target) for x in (bounded, clipped)]
    assert error[0] <= error[1]
