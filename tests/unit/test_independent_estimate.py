"""Accepted fraction of a filter's change, from light with independent noise."""

import numpy as np
import pytest

from engine.postprocess.independent_estimate import denoise_weight
from engine.postprocess.texel_charts import TexelCharts

NOISE = 0.03


def charts(width, count):
    """Return square charts in a row."""
    known = np.zeros((1, width + 2, count * (width + 1) + 1), bool)
    for number in range(count):
        first = 1 + number * (width + 1)
        known[0, 1 : 1 + width, first : first + width] = True
    return TexelCharts(known)


def light(found, seed=1):
    """Return exact light, and that with noise twice, (k, 3) float32 each."""
    random = np.random.default_rng(seed)
    exact = random.uniform(0.5, 1, (len(found.number), 1)) * np.ones(3)
    return [
        (exact + random.normal(0, size, exact.shape)).astype(np.float32) for size in (0, NOISE, 2 * NOISE)
    ]


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def test_a_filter_that_finds_the_light_is_followed():
    found = charts(53, 1)
    exact, noisy, again = light(found)
    part = denoise_weight(noisy, exact, again, found)
    assert np.median(part) > 0.9 and rms(noisy + part[:, None] * (exact - noisy) - exact) < 0.25 * NOISE


@pytest.mark.parametrize("width", [3, 53])
def test_a_filter_that_blurs_details_is_not(width):
    """Although it takes noise, too."""
    found = charts(width, 2809 // width**2)
    exact, noisy, again = light(found)
    quiet = np.full_like(noisy, exact.mean())
    part = denoise_weight(noisy, quiet, again, found)
    assert rms(noisy + part[:, None] * (quiet - noisy) - exact) < rms(noisy - exact)


def test_small_charts_may_keep_what_large_ones_lose():
    found = TexelCharts(np.pad(np.ones((1, 50, 50), bool), ((0, 0), (1, 1), (1, 0))))
    small = charts(2, 600)
    both = TexelCharts(np.zeros((1, 1, 1), bool))
    both.number = np.concatenate([found.number, small.number + 1])
    both.size = np.concatenate([found.size, small.size])
    exact, noisy, again = light(both)
    quiet = exact.copy()
    quiet[len(found.number) :] = 0.75
    part = denoise_weight(noisy, quiet, again, both)
    assert part[: len(found.number)].mean() > 0.8 > 0.2 > part[len(found.number) :].mean()


def test_without_texels_or_changes_there_is_nothing_to_take():
    empty = TexelCharts(np.zeros((1, 5, 7), bool))
    nothing = np.zeros((0, 3), np.float32)
    assert denoise_weight(nothing, nothing, nothing, empty).shape == (0,)
    found = charts(7, 1)
    same = np.ones((49, 3), np.float32)
    assert np.isfinite(denoise_weight(same, same, same, found)).all()
    black = np.zeros((49, 3), np.float32)
    assert np.isfinite(denoise_weight(black, black, same, found)).all()
