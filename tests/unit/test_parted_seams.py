"""Seams under walls are none; all others are."""

import numpy as np
import pytest

from engine.finish.parted_seams import without_parted
from engine.patches.seams import Seams


def seams(*texels):
    """Return seams from column 3 to column 9 of a lightmap, at some rows."""
    pairs = np.array([[(3.5, row), (9.5, row)] for row in texels]).reshape(-1, 2, 2)
    return Seams(np.zeros((len(pairs), 2), np.int32), pairs, np.arange(1.0, len(pairs) + 1))


@pytest.mark.parametrize(
    ("dark", "covers", "kept"),
    [(0.1, True, [2.0]), (0.1, False, [1.0, 2.0]), (0.9, True, [1.0, 2.0])],
    ids=["a wall between light and dark", "light that changes in sight", "a box on an even floor"],
)
def test_seams_are_parted_where_something_covers_one_side_and_light_differs(dark, covers, kept):
    known = np.ones((1, 13, 13), bool)
    light = np.ones((1, 13, 13), np.float32)
    light[0, :, 7:] = dark
    covered = np.zeros_like(known)
    covered[0, :6, 9] = covers
    found = without_parted(seams(2.5, 10.5), covered, light, known)
    np.testing.assert_array_equal(found.weight, kept)


def test_a_side_of_which_nothing_is_known_tells_nothing():
    known = np.zeros((1, 13, 13), bool)
    covered = np.ones_like(known)
    assert len(without_parted(seams(2.5), covered, np.zeros(known.shape, np.float32), known)) == 1
    assert len(without_parted(seams(), covered, np.zeros(known.shape, np.float32), known)) == 0
