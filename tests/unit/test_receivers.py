"""Records of patches: how many patches share a texel."""

import numpy as np
import pytest

from engine.patches.patch_list import PatchList
from engine.visibility.rays.receiver_records import points_of_texels


@pytest.mark.parametrize(
    ("atlas", "texel", "points"),
    [
        ([0, 0, 0], [3, 4, 7], 1),
        ([0, 0, 0, 0], [3, 3, 4, 4], 2),
        ([0, 0, 1, 2], [3, 4, 0, 0], 1),
    ],
)
def test_texels_of_different_atlases_are_different_texels(atlas, texel, points):
    columns = np.array(atlas, np.int32), np.array(texel, np.int32)
    patches = PatchList(8, *columns, np.zeros(len(texel), np.int32), np.zeros((len(texel), 3), np.float32))
    assert points_of_texels(patches) == points
