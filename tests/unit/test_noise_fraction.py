"""The part of a filter's change that counts as noise."""

import numpy as np
import pytest

from engine.postprocess.denoising import noise_fraction
from engine.postprocess.texel_charts import TexelCharts


def charts():
    """Return two large charts and a narrow one, of 900, 900 and 40 texels."""
    known = np.zeros((1, 64, 70), bool)
    known[0, 1:31, 1:31] = known[0, 1:31, 34:64] = known[0, 40, 10:50] = True
    return TexelCharts(known)


def changed(noise, light=1.0):
    """Return light before and after a filter that takes normal noise out, (1840,) each."""
    after = np.full(1840, light, np.float32)
    before = after * (1 + noise * np.random.default_rng(3).normal(size=1840))
    return before.astype(np.float32), after


@pytest.mark.parametrize("light", [1e-6, 1.0, 1e6])
def test_noise_is_taken_and_a_detail_of_a_narrow_chart_stays(light):
    before, after = changed(0.02, light)
    before[[7, 1803]] = 1.3 * light
    part = noise_fraction(before, after, charts())
    assert part[1803] == 0 and np.delete(part, 1803).min() > 0.7 and part[:1800].min() == 1


def test_changes_of_a_small_chart_that_noise_does_not_explain_stay_in_the_main():
    """Three standard deviations in each texel of it: a filter that takes its details for noise."""
    before, after = changed(0.02)
    before[1800:] = 1 + 0.06 * (-1) ** np.arange(40)
    part = noise_fraction(before, after, charts())
    assert (part[:1800] == 1).all()
    assert part[1800:] == pytest.approx(1 / 9, rel=0.15)


def test_among_narrow_charts_alone_what_is_far_above_the_median_is_detail():
    known = np.zeros((1, 64, 70), bool)
    known[0, 1:63:3, 5:65] = True
    before, after = (values[:1260] for values in changed(0.02))
    before[100:103] = 0.6, 0.9, 1.5
    part = noise_fraction(before, after, TexelCharts(known))
    assert part[100] == part[102] == 0 and 0 < part[101] <= 1 and part.mean() > 0.95


def test_no_change_and_black_are_no_noise_to_take():
    same = np.ones(1840, np.float32)
    assert (noise_fraction(same, same, charts()) == 1).all()
    assert (noise_fraction(0 * same, 0 * same, charts()) == 1).all()


def test_nothing_is_known():
    assert (
        len(
            noise_fraction(
                np.zeros(0, np.float32), np.zeros(0, np.float32), TexelCharts(np.zeros((1, 3, 3), bool))
            )
        )
        == 0
    )
