"""Texel samples: which texels have several, their positions, and the displayed value."""

from types import SimpleNamespace

import numpy as np
import pytest

from engine.patches.geometry import PatchGeometry, texel_steps
from engine.patches.patch_list import PatchList
from engine.patches.texel_fragments import TexelClipper
from engine.postprocess import texel_samples as module
from engine.postprocess.irradiance_edges import ON_EDGE, PatchLight, find_edges
from engine.postprocess.texel_means import TexelMeans
from engine.texel_gather import texel_sample_gather
from engine.validity.push_off import pushed_barycentrics
from tests.gpu.test_texel_fragments import nasty_uvs, triangles_of

RESOLUTION = 13


def parts_of(uvs):
    """Return triangles with the patches that lie on them, as far as display samples need them."""
    triangles = triangles_of(np.asarray(uvs, float))
    centre = (np.stack(np.divmod(np.arange(RESOLUTION**2), RESOLUTION)[::-1], axis=1) + 0.5) / RESOLUTION
    texel, triangle = [], []
    for index, corners in enumerate(triangles.uvs.astype(float)):
        edges = corners[1:] - corners[0]
        if abs(np.linalg.det(edges)) < 1e-9:
            continue
        weights = (centre - corners[0]) @ np.linalg.inv(edges)
        inside = (weights > 0).all(axis=1) & (weights.sum(axis=1) < 1)
        new = np.setdiff1d(np.flatnonzero(inside), texel)
        texel, triangle = [*texel, *new], [*triangle, *[index] * len(new)]
    count = len(texel)
    patches = PatchList(
        RESOLUTION, np.zeros(count, np.int32), np.array(texel, np.int32), np.array(triangle, np.int32),
        np.full((count, 3), 1 / 3, np.float32),
    )  # fmt: skip
    steps = texel_steps(triangles, RESOLUTION)
    geometry = PatchGeometry(triangles, steps, patches.triangle, patches.barycentric)
    return SimpleNamespace(triangles=triangles, patches=patches, geometry=geometry)


def display_samples(compute, patch_scene, atlases, known, points):
    """Return the samples, which have as many points in each texel as asked for."""
    clipper = TexelClipper(compute, patch_scene.triangles, RESOLUTION)
    samples, found = module.display_samples(clipper, patch_scene, atlases, known, points)
    assert found == points
    return samples


def even(patch_scene, light=1.0):
    """Return patches that see no backs; light: of each, even unless it is (n,)."""
    count = len(patch_scene.patches)
    lights = np.broadcast_to(light, count).astype(np.float32)[:, None]
    return PatchLight(lights, np.ones(count), np.zeros(count, bool))


SQUARE = np.array([[(2, 3), (7, 3), (7, 9)], [(2, 3), (7, 9), (2, 9)]]) / 13


def test_samples_lie_in_their_texel_and_on_their_triangle_and_weigh_what_is_covered(compute):
    patch_scene = parts_of(nasty_uvs()[:80])
    samples = display_samples(compute, patch_scene, 1, even(patch_scene), 16)
    row, column = np.divmod(samples.texel, RESOLUTION)
    local = samples.position - np.stack([column, row], axis=1)
    assert local.min() > -1e-4 and local.max() < 1 + 1e-4
    assert samples.barycentric.min() > -1e-6 and samples.barycentric.sum(axis=1) == pytest.approx(1, abs=1e-5)
    uv = np.einsum("sk,skd->sd", samples.barycentric, patch_scene.triangles.uvs[samples.triangle])
    assert samples.position == pytest.approx(uv * RESOLUTION, abs=1e-4)
    count = np.bincount(samples.texel)
    assert count[count > 0].min() >= 8
    assert (np.diff(samples.texel) >= 0).all()


def test_even_light_on_a_square_of_whole_texels_needs_no_samples(compute):
    patch_scene = parts_of(SQUARE)
    assert len(display_samples(compute, patch_scene, 1, even(patch_scene), 16)) == 0


@pytest.mark.parametrize("points", [4, 16])
def test_a_square_half_a_texel_off_has_samples_at_its_border(compute, points):
    patch_scene = parts_of(SQUARE + 0.5 / 13)
    samples = display_samples(compute, patch_scene, 1, even(patch_scene), points)
    weight = np.bincount(samples.texel, samples.weight, RESOLUTION**2).reshape(RESOLUTION, RESOLUTION)
    assert weight.sum() == pytest.approx(10, rel=1e-5)
    assert weight[3, 3:7] == pytest.approx(0.5, rel=1e-4) and weight[3, 2] == pytest.approx(0.25, rel=1e-4)
    assert not weight[4:9, 3:7].any()
    assert (np.bincount(samples.texel)[np.unique(samples.texel)] >= points - 2).all()


def test_borders_of_large_charts_need_samples_where_nobody_covers_the_centre(compute):
    """A square 0.3 texels off covers texels below and left by 0.7, those above and right by 0.3."""
    patch_scene = parts_of(SQUARE + 0.3 / 13)
    texel = np.unique(display_samples(compute, patch_scene, 1, even(patch_scene), 4).texel)
    row, column = np.divmod(texel, RESOLUTION)
    assert ((row == 9) | (column == 7)).all() and len(texel) == 6 + 7 - 1
    strip = np.array([[(2, 3.3), (9, 3.3), (9, 4.1)], [(2, 3.3), (9, 4.1), (2, 4.1)]]) / 13
    patch_scene = parts_of(strip)
    assert set(display_samples(compute, patch_scene, 1, even(patch_scene), 4).texel // RESOLUTION) == {3, 4}


def test_an_edge_of_light_has_samples_on_both_sides_and_a_slope_none(compute):
    patch_scene = parts_of(SQUARE)
    column = patch_scene.patches.texel % RESOLUTION
    slope = even(patch_scene, 1 + 0.1 * column)
    assert set(display_samples(compute, patch_scene, 1, slope, 4).texel % RESOLUTION) <= {2, 6}
    samples = display_samples(compute, patch_scene, 1, even(patch_scene, np.where(column < 4, 1, 3)), 4)
    row, column = np.divmod(samples.texel, RESOLUTION)
    ends = (row == row.min()) | (row == row.max())
    assert set(column[~ends]) == {2, 3, 4} and set(column[ends]) == {2, 3, 4, 5}
    assert np.bincount(samples.texel, samples.weight)[samples.texel] == pytest.approx(1, rel=1e-4)
    local = samples.position % 1
    assert np.abs(np.abs(local - 0.5) - 0.25).max() < 1e-4
    assert len(np.unique(np.c_[samples.texel, local > 0.5], axis=0)) == len(samples)


def test_noise_of_a_dark_corner_is_no_edge_but_shadows_in_it_and_beside_it_are(compute):
    width, rng = 67, np.random.default_rng(3)
    light = np.ones((width, width), np.float32)
    light[:, 31:] *= 0.2 * (1 + 0.1 * rng.standard_normal((width, 36)))
    light[:, 9:17] *= 0.75
    light[:, 50:53] *= 0.05
    entries = np.arange(1, width**2 + 1, dtype=np.uint32).reshape(1, width, width)
    count = width**2
    known = PatchLight(light.reshape(-1, 1), np.ones(count, np.float32), np.zeros(count, bool))
    edge = find_edges(compute, entries, known)[0] & ON_EDGE > 0
    assert edge[:, [8, 9, 16, 17, 30, 31]].all()
    assert edge[:, [49, 50, 52, 53]].mean() > 0.9

    # Of texels with nothing but noise hardly any is taken for an edge.
    assert edge[1:-1, 1:8].sum() == edge[1:-1, 18:30].sum() == 0
    assert np.delete(edge[:, 33:], slice(15, 22), axis=1).mean() < 0.03


def test_borders_of_charts_have_samples_beside_light_that_is_hardly_even(compute):
    """A shadow may end beyond the last centres; what is as uneven in the middle of a chart is even enough."""
    patch_scene = parts_of(SQUARE)
    row, column = np.divmod(patch_scene.patches.texel, RESOLUTION)
    inside, beside = ((row == here) & (column == 4) for here in (row.min() + 2, row.max() - 1))
    assert not len(display_samples(compute, patch_scene, 1, even(patch_scene, np.where(inside, 1.07, 1)), 4))
    texels = np.unique(
        display_samples(compute, patch_scene, 1, even(patch_scene, np.where(beside, 1.07, 1)), 4).texel
    )
    assert set(texels // RESOLUTION) == {row.max()} and set(texels % RESOLUTION) == {3, 4, 5}


def test_both_sides_of_a_border_of_what_is_hidden_have_samples(compute):
    patch_scene = parts_of(SQUARE)
    known = even(patch_scene)
    known.invalid[:] = patch_scene.patches.texel % RESOLUTION < 4
    assert set(display_samples(compute, patch_scene, 1, known, 4).texel % RESOLUTION) == {3, 4}


def test_a_triangle_far_smaller_than_a_texel_has_samples(compute):
    """The first is a sliver beside no patch, the second covers a twentieth of a texel, off its centre."""
    small = np.array([[(9.2, 5.2), (9.21, 5.2), (9.2, 5.22)], [(9.1, 9.1), (9.4, 9.1), (9.1, 9.4)]]) / 13
    patch_scene = parts_of(np.concatenate([SQUARE, small]))
    samples = display_samples(compute, patch_scene, 1, even(patch_scene), 16)
    assert set(samples.triangle) == {3} and set(samples.texel) == {9 * RESOLUTION + 9}


def test_texels_show_the_weighted_mean_of_visible_samples(compute):
    patch_scene = parts_of(SQUARE + 0.5 / 13)
    samples = display_samples(compute, patch_scene, 1, even(patch_scene), 4)
    values = np.random.default_rng(3).random((len(samples), 3)).astype(np.float32)
    visible = samples.texel % RESOLUTION != 2
    means = TexelMeans(compute, samples, visible, (1, RESOLUTION, RESOLUTION))
    assert set(means.invalid % RESOLUTION) == {2} and not set(means.texels % RESOLUTION) & {2}
    for texel, mean in zip(means.texels, means.of(values)[: len(means.texels)], strict=True):
        mine = samples.texel == texel
        assert mean == pytest.approx(np.average(values[mine], axis=0, weights=samples.weight[mine]), rel=1e-5)
    assert means.of(values[:, 0]) == pytest.approx(means.of(values)[:, :1])


def test_samples_have_the_steps_of_their_width():
    triangles = triangles_of(SQUARE)
    where = np.array([0, 1], np.int32), np.full((2, 3), 1 / 3, np.float32)
    steps = texel_steps(triangles, RESOLUTION)
    whole, half = (PatchGeometry(triangles, steps, *where, width=width) for width in (1.0, 0.5))
    for part in (half, half.subset(slice(0, 2))):
        assert np.array_equal(part.edge_u, whole.edge_u / 2) and whole.edge_u.any()
        assert np.array_equal(part.edge_v, whole.edge_v / 2)
        assert np.array_equal(part.area, whole.area / 4)
        assert np.array_equal(part.center, whole.center)


def test_points_that_leave_their_triangle_are_not_pushed():
    triangles = triangles_of(SQUARE)
    steps = texel_steps(triangles, RESOLUTION)
    middle = np.full((2, 3), 1 / 3, np.float32)
    geometry = PatchGeometry(triangles, steps, np.array([0, 1], np.int32), middle)
    offset = np.array([[0.02, 0.03, 0], [-0.5, 0, 0]], np.float32)
    moved, stays = pushed_barycentrics(geometry, offset)
    assert stays.tolist() == [True, False]
    at = np.einsum("k,kd->d", moved[0], triangles.positions[0])
    assert at == pytest.approx(geometry.center[0] + offset[0], abs=1e-6)


@pytest.mark.parametrize("most", [5, 8, 1000])
def test_batches_end_between_texels(compute, monkeypatch, most):
    monkeypatch.setattr(texel_sample_gather, "_BATCH", most)
    patch_scene = parts_of(SQUARE + 0.5 / 13)
    samples = display_samples(compute, patch_scene, 1, even(patch_scene), 4)
    device = SimpleNamespace(device=SimpleNamespace(global_mem_size=0))
    batches, done = zip(*texel_sample_gather._batches(samples, device), strict=True)
    assert np.array_equal(np.concatenate([batch.position for batch in batches]), samples.position)
    texels = [set(batch.texel) for batch in batches]
    assert sum(map(len, texels)) == len(samples.starts) and max(map(len, batches)) < most + 4
    assert [first for first, _ in done[1:]] == [last for _, last in done[:-1]] and done[-1][1] == 1


@pytest.mark.parametrize(("most", "points", "texels"), [(352, 16, 22), (351, 4, 22), (40, 4, 8)])
def test_too_many_points_become_fewer_in_every_texel_and_then_in_fewer_texels(
    compute, monkeypatch, most, points, texels
):
    """The border of a square half a texel off covers 22 texels in part."""
    monkeypatch.setattr(module, "_MOST_POINTS", most)
    patch_scene = parts_of(SQUARE + 0.5 / 13)
    clipper = TexelClipper(compute, patch_scene.triangles, RESOLUTION)
    samples, found = module.display_samples(clipper, patch_scene, 1, even(patch_scene), 16)
    assert found == points and len(samples) == points * texels
    assert len(np.unique(samples.texel)) == texels


def test_a_texel_with_many_triangles_has_no_more_points_than_others(compute):
    """A fan of 300 triangles on a border of two texels: each point stands for the same area."""
    angle = np.linspace(0, 2 * np.pi, 301)
    middle = np.array((10.0, 10.5))
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1) * 0.4 + middle
    fan = np.stack([np.broadcast_to(middle, (300, 2)), rim[:-1], rim[1:]], axis=1) / 13
    patch_scene = parts_of(np.concatenate([SQUARE, fan]))
    samples = display_samples(compute, patch_scene, 1, even(patch_scene), 16)
    assert (np.bincount(samples.texel)[[139, 140]] == 16).all() and len(samples) == 32
    covered = np.bincount(samples.texel, samples.weight)[[139, 140]]
    assert covered == pytest.approx(np.pi * 0.4**2 / 2, rel=1e-3)
    mean = np.average(samples.position - middle, axis=0, weights=samples.weight)
    assert np.abs(mean).max() < 0.03
