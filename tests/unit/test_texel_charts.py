"""Charts of lightmaps: connected texels, the level of their light, and dark charts."""

import numpy as np
import pytest

from engine.postprocess.texel_charts import TexelCharts


def flooded(known):
    """Return the number of the chart of each known texel, (k,), by walking from texel to texel."""
    number = np.full(known.shape, -1)
    for chart, seed in enumerate(np.argwhere(known)):
        left = [tuple(seed)]
        while left:
            at = left.pop()
            if number[at] >= 0:
                continue
            number[at] = chart
            atlas, row, column = at
            for y, x in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)):
                if 0 <= y < known.shape[1] and 0 <= x < known.shape[2] and known[atlas, y, x]:
                    left.append((atlas, y, x))
    return number[known]


@pytest.mark.parametrize("shape", [(1, 1, 1), (3, 1, 7), (2, 13, 1), (2, 17, 31), (3, 31, 17)])
@pytest.mark.parametrize("density", [0.3, 0.6, 0.95])
def test_each_texel_has_the_mean_of_those_it_is_joined_with_side_by_side(shape, density):
    random = np.random.default_rng(5)
    known = random.random(shape) < density
    image = random.uniform(0.5, 1, (*shape, 3)).astype(np.float32)
    found, number = TexelCharts(known).levels(image), flooded(known)
    for chart in np.unique(number):
        members = number == chart
        np.testing.assert_allclose(
            found[members], np.tile(image[known][members].mean(axis=0), (members.sum(), 1)), rtol=1e-5
        )


def test_lightmaps_are_apart_and_so_are_charts_that_touch_at_a_corner():
    known = np.zeros((2, 3, 3), bool)
    known[0, 2, 1] = known[1, 0, 1] = known[1, 1, 2] = True
    image = np.zeros((2, 3, 3, 3), np.float32)
    image[0, 2, 1], image[1, 0, 1], image[1, 1, 2] = 2, 3, 5
    assert (TexelCharts(known).levels(image)[:, 0] == [2, 3, 5]).all()


def test_a_chart_of_uneven_light_has_the_level_of_all():
    known = np.zeros((1, 9, 9), bool)
    known[0, 1:5, 1:5] = known[0, 7, 1:5] = True
    image = np.zeros((1, 9, 9, 3), np.float32)
    image[0, 2, 2], image[0, 7, 1:5] = 16, 1
    levels = TexelCharts(known).levels(image)
    assert (levels[:16] == 1).all() and (levels[16:] == 1).all()
    image[0, 7, 1:5] = 6
    levels = TexelCharts(known).levels(image)
    assert (levels[:16] == 2).all() and (levels[16:] == 6).all()


def test_what_is_black_has_the_level_1():
    known = np.ones((1, 2, 2), bool)
    image = np.zeros((1, 2, 2, 3), np.float32)
    image[..., 1] = 4
    assert (TexelCharts(known).levels(image) == [1, 4, 1]).all()


def test_nothing_known_has_no_levels():
    assert TexelCharts(np.zeros((1, 4, 4), bool)).levels(np.ones((1, 4, 4, 3), np.float32)).shape == (0, 3)
