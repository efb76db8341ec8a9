import numpy as np
import pytest

from engine.postprocess.membrane_fill import MembraneFill


@pytest.mark.parametrize("shape", [(1, 1), (1, 17), (13, 7), (64, 64), (129, 31)])
def test_holes_of_a_constant_are_constant_and_known_texels_keep_their_bits(shape):
    random = np.random.default_rng(0)
    known = random.random(shape) < 0.05
    known.ravel()[-1] = True
    image = random.random((*shape, 3)).astype(np.float32)
    kept = image[known]
    image[known] = kept
    MembraneFill(known, np.ones_like(known)).fill(image)
    assert (image[known] == kept).all() and np.isfinite(image).all()
    assert image.min() >= kept.min() - 1e-6 and image.max() <= kept.max() + 1e-6
    flat = np.where(known[..., None], np.float32(0.7), np.float32(9))
    flat = np.ascontiguousarray(np.broadcast_to(flat, (*shape, 3)))
    MembraneFill(known, np.ones_like(known)).fill(flat)
    np.testing.assert_allclose(flat, 0.7, rtol=1e-6)


def test_only_what_is_to_be_filled_is():
    known, filled = np.zeros((2, 20, 33), bool)
    known[3:9, 4:11] = True
    filled[2:15, 3:20] = True
    image = np.ones((20, 33, 2), np.float32)
    MembraneFill(known, filled).fill(image)
    np.testing.assert_allclose(image[filled | known], 1, rtol=1e-6)
    assert (image[~filled & ~known] == 0).all()


def test_hole_in_a_slope_is_filled_nearly_straight():
    """A membrane over a hole keeps a linear slope; rings from its border would meet in a star."""
    y, x = np.mgrid[:61, :61].astype(np.float32)
    slope = (0.3 * x + 0.1 * y + 2)[:, :, None]
    known = np.ones((61, 61), bool)
    known[11:50, 14:47] = False
    image = slope * known[:, :, None]
    MembraneFill(known, ~known).fill(image)
    off = np.abs(image - slope)[~known]
    assert off.max() < 0.05 * np.ptp(slope)
    rough = np.abs(np.diff(image[:, :, 0], 2, axis=0))[20:40, 20:40]
    assert rough.max() < 0.02 * np.ptp(slope)


def test_nothing_known_stays_black():
    image = np.ones((5, 4, 3), np.float32)
    MembraneFill(np.zeros((5, 4), bool), np.ones((5, 4), bool)).fill(image)
    assert (image == 0).all()
