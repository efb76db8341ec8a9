"""Selection of the objects whose back faces may be lit."""

import numpy as np

from engine.texel_gather.lit_back_faces import _may_be_dark


def test_few_sampled_patches_do_not_show_that_an_object_is_lit():
    """One sample of a dark object may lie in a lit corner."""
    count = np.array([0, 1, 7, 997, 997])
    total = np.array([0, 1, 7, 997, 997 * 0.05])
    assert _may_be_dark(count, total, 1.0).tolist() == [True, True, True, False, True]
