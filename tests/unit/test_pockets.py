"""Texel samples in pockets are dropped next to far brighter open ones, and dim rooms keep theirs."""

import numpy as np
import pytest

from engine.texel_gather.pockets import in_pockets


@pytest.mark.parametrize(
    ("light", "enclosed", "dropped"),
    [
        ((0.02, 0.03, 1.9, 1.8), (1, 1, 0, 0), (1, 1, 0, 0)),  # half of the texel is in a pocket
        ((0.30, 0.25, 1.9, 1.8), (1, 1, 0, 0), (0, 0, 0, 0)),  # a dim room whose walls face outward
        ((0.02, 0.03, 1.9, 1.8), (0, 0, 0, 0), (0, 0, 0, 0)),  # a shadow, or a dark room
        ((0.02, 0.03, 1.9, 1.8), (1, 1, 1, 1), (0, 0, 0, 0)),  # no open sample
        ((0.02, 0.03, 0.0, 0.0), (1, 1, 0, 0), (0, 0, 0, 0)),  # all dark
    ],
)
def test_only_enclosed_samples_far_darker_than_open_ones_are_dropped(light, enclosed, dropped):
    starts, bright = np.array([0, 4, 8]), np.full(4, 5.0)
    everywhere = np.concatenate([bright, light, bright]).astype(np.float32)
    around = np.concatenate([np.zeros(4), enclosed, np.ones(4)]).astype(bool)
    found = in_pockets(starts, np.ones(12, bool), around, everywhere)
    assert list(found) == [4 + place for place in range(4) if dropped[place]]


def test_invalid_samples_neither_count_as_open_nor_are_dropped():
    starts, light = np.zeros(1, np.int64), np.array([0.01, 0.01, 1.0, 1.0], np.float32)
    enclosed, visible = np.array([1, 1, 0, 0], bool), np.array([1, 0, 0, 1], bool)
    assert list(in_pockets(starts, visible, enclosed, light)) == [0]
    assert not len(in_pockets(starts, np.array([1, 1, 0, 0], bool), enclosed, light))
