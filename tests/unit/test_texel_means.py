"""What texels show of their samples: means, and where something cuts a texel, what its centre would have."""

import numpy as np
import pytest

from engine.finish.bilinear import footprints
from engine.finish.display_samples import DisplaySamples, no_samples
from engine.finish.texel_means import TexelMeans

RESOLUTION, ATLASES, ACROSS = 7, 2, 4

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
    return DisplaySamples(atlas.astype(np.int32), texel, position, weight, *none)


def centres(texels):
    row, column = np.divmod(texels % RESOLUTION**2, RESOLUTION)
    return np.stack([column, row], axis=1) + 0.5


@pytest.mark.parametrize("line", [2.2, 3.0, 3.13, 3.6, 3.9, 6.9])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_texel_that_something_cuts_shows_what_its_centre_would_have(line, axis):
    """Light is even in slope, and hidden on one side of a line across the texels of the first lightmap."""
    samples = samples_of_all_texels()
    visible = (samples.position[:, axis] < line) | (samples.atlas == 1)
    values = (LIGHT + samples.position @ SLOPE) * (1 - samples.atlas[:, None])
    values[~visible], values[-1] = 1e6, 99
    means = TexelMeans(samples, visible, RESOLUTION)
    first = means.shown < RESOLUTION**2
    shown = means.of(values.astype(np.float32))[first]
    assert shown == pytest.approx(LIGHT + centres(means.shown[first]) @ SLOPE, rel=0.02)


def test_texels_beyond_what_is_seen_are_those_that_it_reads():
    """They are beyond a line past centres of texels; before centres the texels that it is in are read."""
    samples = samples_of_all_texels()
    means = TexelMeans(samples, samples.position[:, 0] < 3.8, RESOLUTION)
    assert set(means.beyond % RESOLUTION) == {4} and len(means.beyond) == ATLASES * RESOLUTION
    assert set(means.hidden % RESOLUTION) == {4, 5, 6}
    assert len(TexelMeans(samples, samples.position[:, 0] < 3.3, RESOLUTION).beyond) == 0


@pytest.mark.parametrize("line", [3.1, 3.87])
@pytest.mark.parametrize("axis", [0, 1])
def test_light_that_bends_up_to_what_cuts_it_is_shown_where_it_is_seen(line, axis):
    """As beside a lamp at a ceiling, or at the foot of a wall: planes are off by up to 2.4 and 4.7 %."""
    samples = samples_of_all_texels()
    place = samples.position[:, axis]
    light = np.stack([np.exp(0.45 * (place - line)), np.sqrt(line + 0.3 - np.minimum(place, line))], axis=1)
    light[-2:] = [[0, 0], [9, 9]]
    visible = (place < line) | (samples.atlas == 1)
    means = TexelMeans(samples, visible, RESOLUTION)
    image = np.zeros((ATLASES * RESOLUTION**2, 2))
    image[means.shown] = means.of(light.astype(np.float32))
    texels, weights = footprints(samples.atlas, samples.position, RESOLUTION)
    shown = np.einsum("sk,skc->sc", weights, image[texels])
    inside = np.abs(samples.position - RESOLUTION / 2).max(axis=1) < RESOLUTION / 2 - 1
    foot = inside & (samples.atlas == 0) & (place < line) & (place > line - 0.5)
    off = shown[foot] / light[foot] - 1
    assert (np.sqrt((off**2).mean(axis=0)) < (0.01, 0.02)).all()


def test_whole_texels_show_the_bits_of_their_means():
    samples = samples_of_all_texels()
    values = np.random.default_rng(3).uniform(0, 2, len(samples)).astype(np.float32)
    means = TexelMeans(samples, np.ones(len(samples), bool), RESOLUTION)
    expected = values.reshape(-1, ACROSS**2).astype(np.float64).mean(axis=1).astype(np.float32)
    assert np.array_equal(means.of(values)[:, 0], expected) and len(means.shown) == len(expected)


def test_nothing_leaves_the_range_of_all_samples():
    """Of masks between 0 and 1, and of a texel of which one sample is seen."""
    samples = samples_of_all_texels()
    random = np.random.default_rng(5)
    mask = (random.uniform(size=len(samples)) < samples.position[:, 0] / RESOLUTION).astype(np.float32)
    visible = (samples.position[:, 0] < 3.2) | (np.arange(len(samples)) % 97 == 0)
    shown = TexelMeans(samples, visible, RESOLUTION).of(mask)
    assert shown.min() >= 0 and shown.max() <= 1 and np.isfinite(shown).all()


def test_samples_that_were_pushed_out_count_where_there_are_no_others():
    samples = samples_of_all_texels()
    pushed = samples.position[:, 0] > 3
    samples.weight[pushed] *= 1e-3
    values = np.where(pushed, 9.0, 1.0).astype(np.float32)
    means = TexelMeans(samples, np.ones(len(samples), bool), RESOLUTION)
    shown = means.of(values)[:, 0].reshape(ATLASES, RESOLUTION, RESOLUTION)
    assert shown[:, :, 3:] == pytest.approx(9) and shown[:, :, :2] == pytest.approx(1)


def test_no_samples_are_no_texels():
    means = TexelMeans(no_samples(), np.zeros(0, bool), RESOLUTION)
    assert len(means.shown) == len(means.hidden) == 0 and means.of(np.zeros((0, 3), np.float32)).shape == (
        0,
        3,
    )
