"""Charts that lie near each other on a lightmap: the seam of one is not seen on the other."""

import numpy as np
import pytest

from engine.patches.seams import no_seams
from engine.postprocess import seam_lookups
from engine.postprocess.bilinear_equations import display_equations
from engine.postprocess.final_images import FinalImages
from engine.postprocess.seam_lookups import display_seams
from tests.seams import find_seams
from tests.unit.test_bilinear_fit import centres, covered, points_at, shown, step
from tests.unit.test_seams import R, joined, tile

NO_POINTS = points_at(np.zeros((0, 2)))


def near_charts(gap, offset):
    """Return two lit charts that share a seam, and a dark one beside the first; the chart of the dark one.

    gap, offset:  texels between lit and dark, and of their borders from those of texels
    """
    lit = tile((0, 0), (2, 2), (3, 4 + offset, 17 + offset, 16))
    beyond_seam = tile((2, 0), (2, 2), (4, 38, 17, 16))
    chart = (20 + offset + gap, 4 + offset, 17, 16)
    return joined(lit, beyond_seam, tile((9, 0), (2, 2), chart)), chart


def case_of(triangles, seams):
    """Return what a fit takes and the light of texels: 1 on what is lit, 0.2 elsewhere."""
    mask, world = covered(triangles, 1)
    texels = np.zeros((1, R, R, 1), np.float32)
    texels[mask] = np.where(world[:, :1] < 5, 1, 0.2)
    return (mask, NO_POINTS, seams, mask, 2), texels


def all_over(chart):
    """Return points all over a chart, borders included, (p, 2) texels."""
    x, y, width, height = chart
    along = np.linspace(0, 1, 61)
    return np.stack(np.meshgrid(x + width * along, y + height * along), axis=2).reshape(-1, 2)


def images_of(display, triangles):
    """Return images without and with seams hidden, by `FinalImages` or what makes the same, and the seams."""
    images = []
    for some in (no_seams(), display_seams(triangles, 1, R)):
        case, texels = case_of(triangles, some)
        images.append(display(*case).images(texels, np.zeros((0, 1), np.float32)))
    return (*images, find_seams(triangles, 1, R))


@pytest.mark.parametrize("offset", [0, 0.3, 0.6])
@pytest.mark.parametrize("gap", [2, 2.3, 3])
def test_seam_is_not_seen_on_a_chart_beside_it(gap, offset):
    triangles, chart = near_charts(gap, offset)
    _, fitted, seams = images_of(FinalImages, triangles)
    np.testing.assert_allclose(shown(fitted, 0, all_over(chart)), 0.2, rtol=0.005)
    assert len(seams) > 20 and step(fitted, seams) < 1e-3


@pytest.mark.parametrize("offset", [0, 0.3, 0.6])
@pytest.mark.parametrize("gap", [0.7, 1, 1.4])
def test_gutter_that_two_charts_read_is_as_without_seams(gap, offset):
    triangles, chart = near_charts(gap, offset)
    plain, fitted, seams = images_of(FinalImages, triangles)
    before, after = (shown(images, 0, all_over(chart)) for images in (plain, fitted))
    np.testing.assert_allclose(after, before, rtol=0.005)
    assert step(fitted, seams) <= step(plain, seams) + 1e-4


def test_only_sides_beside_a_free_border_move():
    triangles, _ = near_charts(1, 0)
    seams, own = (find(triangles, 1, R) for find in (find_seams, display_seams))
    np.testing.assert_array_equal(own.weight, seams.weight)
    moved = (own.texel != seams.texel).any(axis=2)
    beside = np.isclose(seams.texel[:, :, 0], 20)
    assert (moved == beside).all() and (own.texel[beside, 0] == 19.5).all()
    for gap in (2, 2.6, 3):
        triangles, _ = near_charts(gap, 0.3)
        seams, own = (find(triangles, 1, R) for find in (find_seams, display_seams))
        np.testing.assert_array_equal(own.texel, seams.texel)


def test_smoothness_ties_no_texels_of_different_charts():
    """The lit border lies on centres up to rounding; the dark chart's seam reads the texels beside these."""
    charts = [(3.5, 5, 16.001, 16), (4.5, 38, 16, 16), (20.7, 5, 16, 16), (40.3, 38, 16, 16)]
    corners = [(0, 0), (2, 0), (9, 0), (7, 0)]
    triangles = joined(*(tile(corner, (2, 2), chart) for corner, chart in zip(corners, charts, strict=True)))
    mask, _ = covered(triangles, 1)
    equations = display_equations(centres(mask), find_seams(triangles, 1, R), R, 1)
    lit = equations.texel % R < 20
    dark = (equations.texel % R >= 20) & (equations.texel < 30 * R)
    assert dark.sum() > 20 and not equations.smooth.times(dark.astype(float))[lit].any()


@pytest.mark.parametrize("pairs", [1, 7])
def test_seams_do_not_depend_on_the_number_of_pairs_that_are_compared_at_once(pairs, monkeypatch):
    triangles, _ = near_charts(0.7, 0.3)
    whole = display_seams(triangles, 1, R)
    assert not np.array_equal(whole.texel, find_seams(triangles, 1, R).texel)
    monkeypatch.setattr(seam_lookups, "_PAIRS", pairs)
    parts = display_seams(triangles, 1, R)
    for name in ("atlas", "texel", "weight"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))
