"""Texel values from samples: means, and extrapolation to the centre of cut texels."""

import numpy as np
import pytest

from engine.postprocess.bilinear import footprints
from engine.postprocess.texel_means import TexelMeans
from engine.postprocess.texel_samples import TexelSamples

RESOLUTION, ATLASES, ACROSS = 7, 2, 4
SHAPE = (ATLASES, RESOLUTION, RESOLUTION)

#: Light at the place (0, 0) and its slopes along u and v, a texel each, of three channels.
LIGHT, SLOPE = np.array([3.0, 5.0, 0.7]), np.array([[0.11, -0.3, 0.0], [0.07, 0.2, -0.05]])


def samples_of_all_texels(resolution=RESOLUTION):
    """Return 4 x 4 samples of each texel of two lightmaps."""
    step = (np.arange(ACROSS) + 0.5) / ACROSS
    atlas, row, column, v, u = (
        axis.ravel()
        for axis in np.meshgrid(
            np.arange(ATLASES), np.arange(resolution), np.arange(resolution), step, step, indexing="ij"
        )
    )
    position = np.stack([column + u, row + v], axis=1).astype(np.float32)
    count = len(atlas)
    texel, weight = (row * resolution + column).astype(np.int32), np.full(count, 1 / ACROSS**2, np.float32)
    none = np.zeros(count, np.int32), np.zeros((count, 3), np.float32)
    return TexelSamples(atlas.astype(np.int32), texel, position, weight, *none)


def centres(texels):
    row, column = np.divmod(texels % RESOLUTION**2, RESOLUTION)
    return np.stack([column, row], axis=1) + 0.5


@pytest.mark.parametrize("line", [2.2, 3.0, 3.13, 3.6, 3.9, 6.9])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_texel_that_something_cuts_shows_what_its_centre_would_have(compute, line, axis):
    """Light is even in slope, and hidden on one side of a line across the texels of the first lightmap."""
    samples = samples_of_all_texels()
    visible = (samples.position[:, axis] < line) | (samples.atlas == 1)
    values = (LIGHT + samples.position @ SLOPE) * (1 - samples.atlas[:, None])
    values[~visible], values[-1] = 1e6, 99
    means = TexelMeans(compute, samples, visible, SHAPE)
    first = means.shown < RESOLUTION**2
    shown = means.of(values.astype(np.float32))[first]
    assert shown == pytest.approx(LIGHT + centres(means.shown[first]) @ SLOPE, rel=0.02)


def test_texels_beyond_what_is_seen_are_those_that_it_reads(compute):
    """They are beyond a line past centres of texels; before centres the texels that it is in are read."""
    samples = samples_of_all_texels()
    means = TexelMeans(compute, samples, samples.position[:, 0] < 3.8, SHAPE)
    assert set(means.beyond % RESOLUTION) == {4} and len(means.beyond) == ATLASES * RESOLUTION
    assert set(means.invalid % RESOLUTION) == {4, 5, 6}
    assert len(TexelMeans(compute, samples, samples.position[:, 0] < 3.3, SHAPE).beyond) == 0


@pytest.mark.parametrize("line", [3.1, 3.87])
@pytest.mark.parametrize("axis", [0, 1])
def test_light_that_bends_up_to_what_cuts_it_is_shown_where_it_is_seen(compute, line, axis):
    """As beside a lamp at a ceiling, or at the foot of a wall: planes are off by up to 2.4 and 4.7 %."""
    samples = samples_of_all_texels()
    place = samples.position[:, axis]
    bends = np.exp(0.45 * (place - line)), np.sqrt(line + 0.3 - np.minimum(place, line))
    light = np.stack([*bends, np.ones(len(place))], axis=1)
    light[-2:] = [[0, 0, 0], [9, 9, 9]]
    visible = (place < line) | (samples.atlas == 1)
    means = TexelMeans(compute, samples, visible, SHAPE)
    image = np.zeros((ATLASES * RESOLUTION**2, 3))
    image[means.shown] = means.of(light.astype(np.float32))
    texels, weights = footprints(samples.atlas, samples.position, RESOLUTION)
    shown = np.einsum("sk,skc->sc", weights, image[texels])
    inside = np.abs(samples.position - RESOLUTION / 2).max(axis=1) < RESOLUTION / 2 - 1
    foot = inside & (samples.atlas == 0) & (place < line) & (place > line - 0.5)
    off = shown[foot] / light[foot] - 1
    assert (np.sqrt((off**2).mean(axis=0)) < (0.01, 0.02, 1e-3)).all()


def test_whole_texels_show_their_means_to_the_last_bit(compute):
    samples = samples_of_all_texels()
    values = np.random.default_rng(3).uniform(0, 2, len(samples)).astype(np.float32)
    means = TexelMeans(compute, samples, np.ones(len(samples), bool), SHAPE)
    expected = values.reshape(-1, ACROSS**2).astype(np.float64).mean(axis=1).astype(np.float32)
    off = np.abs(means.of(values)[:, 0] - expected)
    assert (off <= np.spacing(expected)).all() and len(means.shown) == len(expected)


def test_nothing_leaves_the_range_of_all_samples(compute):
    """Of masks between 0 and 1, and of a texel of which one sample is seen."""
    samples = samples_of_all_texels()
    random = np.random.default_rng(5)
    mask = (random.uniform(size=len(samples)) < samples.position[:, 0] / RESOLUTION).astype(np.float32)
    visible = (samples.position[:, 0] < 3.2) | (np.arange(len(samples)) % 97 == 0)
    shown = TexelMeans(compute, samples, visible, SHAPE).of(mask)
    assert shown.min() >= 0 and shown.max() <= 1 and np.isfinite(shown).all()


def test_samples_that_were_pushed_out_count_where_there_are_no_others(compute):
    samples = samples_of_all_texels()
    pushed = samples.position[:, 0] > 3
    samples.weight[pushed] *= 1e-3
    values = np.where(pushed, 9.0, 1.0).astype(np.float32)
    means = TexelMeans(compute, samples, np.ones(len(samples), bool), SHAPE)
    shown = means.of(values)[:, 0].reshape(ATLASES, RESOLUTION, RESOLUTION)
    assert shown[:, :, 3:] == pytest.approx(9) and shown[:, :, :2] == pytest.approx(1)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e7])
def test_planes_are_those_of_weighted_least_squares(compute, scale):
    """But for a little of the weight, which light has no slope over; not all of 3 x 3 texels have samples."""
    rng = np.random.default_rng(3)
    texels = np.array([8, 9, 10, 15, 16, 22, 24, 41])
    number = np.repeat(np.arange(len(texels)), rng.integers(5, 9, len(texels)))
    row, column = np.divmod(texels[number], RESOLUTION)
    place = rng.uniform(0, 1, (len(number), 2))
    position = (place + np.stack([column, row], axis=1)).astype(np.float32)
    weight = (scale * rng.uniform(0.1, 3, len(number))).astype(np.float32)
    visible, values = np.ones(len(number), bool), 2 + 0.1 * rng.random((len(number), 3)).astype(np.float32)
    values[:, 1] += position[:, 0] - 0.5 * position[:, 1]
    for cut in (16, 9):
        visible[np.flatnonzero(texels[number] == cut)[-1]] = False
    none = np.zeros(len(number), np.int32)
    samples = TexelSamples(
        none, texels[number].astype(np.int32), position, weight, none, np.zeros((len(number), 3), np.float32)
    )
    means = TexelMeans(compute, samples, visible, SHAPE)
    shown = dict(zip(means.texels, means.of(values), strict=True))
    for centre in (16, 9):
        up, right = row - centre // RESOLUTION, column - centre % RESOLUTION
        near = (abs(up) <= 1) & (abs(right) <= 1) & visible
        middle = np.array([centre % RESOLUTION, centre // RESOLUTION]) + 0.5
        root, offset = np.sqrt(weight[near].astype(float))[:, None], position[near] - middle
        rows = np.concatenate([root * np.column_stack([np.ones(near.sum()), offset]),
                               np.sqrt(0.003 * weight[near].sum()) * np.eye(3)[1:]])  # fmt: skip
        plane = np.linalg.lstsq(rows, np.concatenate([root * values[near], np.zeros((2, 3))]), rcond=None)[0]
        own = (texels[number] == centre) & visible
        mean = np.average(values[own], axis=0, weights=weight[own])
        centroid = np.average(position[own] - middle, axis=0, weights=weight[own])
        assert shown[centre] == pytest.approx(mean - centroid @ plane[1:], rel=1e-6)


@pytest.mark.parametrize("scale", [1e-20, 1.0, 1e20])
def test_light_goes_on_as_far_as_samples_spread(compute, scale):
    """Along a strip of texels slopes hold; across it, a twentieth of a texel, they are noise."""
    rng = np.random.default_rng(7)
    texels, each = np.arange(22, 27), 16
    number = np.repeat(np.arange(len(texels)), each)
    along = rng.uniform(-0.5, 0.5, (len(texels), each // 2))
    across = 0.4 + 0.05 * rng.uniform(-1, 1, len(number))
    place = np.column_stack([np.concatenate([along, 0.3 - along], axis=1).ravel(), across])
    column, row = texels[number] % RESOLUTION, texels[number] // RESOLUTION
    position = (place + np.stack([column, row], axis=1) + 0.5).astype(np.float32)
    weight, none = np.full(len(number), scale, np.float32), np.zeros(len(number), np.int32)
    visible = np.arange(len(number)) % each > 0
    samples = TexelSamples(
        none, texels[number].astype(np.int32), position, weight, none, np.zeros((len(number), 3), np.float32)
    )
    noise = rng.normal(size=len(number))
    light = np.column_stack([2 * position[:, 0], 1 - 3 * position[:, 0], noise]).astype(np.float32)
    means = TexelMeans(compute, samples, visible, SHAPE)
    shown = dict(zip(means.texels, means.of(light), strict=True))
    for centre in texels[1:4]:
        own = (texels[number] == centre) & visible
        near = (abs(texels[number] - centre) <= 1) & visible
        off, way = place[near] + (texels[number][near] - centre)[:, None] * [1, 0], place[own].mean(axis=0)
        spread = np.cov(off.T, bias=True) + 0.003 * np.eye(2)
        centred, more = off - off.mean(axis=0), light[near] - light[near].mean(axis=0)
        slope = np.linalg.solve(spread, centred.T @ more / near.sum())
        part = 1.4 / np.sqrt(max(way @ np.linalg.solve(spread, way), 1.4**2))
        assert part < 0.5
        assert shown[centre] == pytest.approx(
            light[own].mean(axis=0) - part * way @ slope, rel=1e-3, abs=1e-4
        )
