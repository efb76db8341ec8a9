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
    keys, bright = np.repeat([3, 7, 9], 4), np.full(4, 5.0)
    everywhere = np.concatenate([bright, light, bright]).astype(np.float32)
    around = np.concatenate([np.zeros(4), enclosed, np.ones(4)]).astype(bool)
    found = in_pockets(keys, np.ones(12, bool), around, everywhere)
    assert (
        list(found[4:8]) == [bool(drop) for drop in dropped] and not found[[*range(4), *range(8, 12)]].any()
    )


def test_invalid_samples_neither_count_as_open_nor_are_dropped():
    keys, light = np.zeros(4, np.int64), np.array([0.01, 0.01, 1.0, 1.0], np.float32)
    enclosed, visible = np.array([1, 1, 0, 0], bool), np.array([1, 0, 0, 1], bool)
    assert list(in_pockets(keys, visible, enclosed, light)) == [True, False, False, False]
    assert not in_pockets(keys, np.array([1, 1, 0, 0], bool), enclosed, light).any()
