import numpy as np

from engine.postprocess.dilation import Dilation


def test_known_texels_keep_their_bits_and_rings_grow():
    rng = np.random.default_rng(0)
    known = np.zeros((20, 30), bool)
    known[8:12, 10:18] = True
    image = rng.random((20, 30, 3), np.float32)
    filled = filled_by(Dilation(known, 3), image)
    assert (filled[known].view(np.uint32) == image[known].view(np.uint32)).all()
    grown = np.zeros_like(known)
    grown[5:15, 7:21] = True
    assert (filled[grown] > 0).all() and (filled[~grown] == 0).all()


def test_a_constant_stays_constant_up_to_the_border():
    known = np.zeros((9, 9), bool)
    known[0, 0] = True
    filled = filled_by(Dilation(known, 20), np.full((9, 9, 3), 0.7, np.float32))
    np.testing.assert_allclose(filled, 0.7, rtol=1e-6)


def test_nothing_known_stays_black():
    nothing = np.zeros((4, 4), bool)
    assert (filled_by(Dilation(nothing, 8), np.ones((4, 4, 3), np.float32)) == 0).all()


def filled_by(dilation, image):
    filled = image.copy()
    dilation.fill(filled)
    return filled


def test_texel_beside_a_surface_takes_its_light_alone():
    image = np.zeros((1, 5, 1), np.float32)
    image[0, [0, 2], 0] = 1, 9
    known, surface = (image[:, :, 0] > 0), (image[:, :, 0] == 1)
    assert (filled_by(Dilation(known, 1, surface), image)[0, :, 0] == [1, 1, 9, 9, 0]).all()
