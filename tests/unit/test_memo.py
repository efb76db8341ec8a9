"""Memoization of the last results."""

import numpy as np
import pytest

from engine.scene.memo import Memo


def made(memo: Memo[int], values: list[int]) -> list[bool]:
    """Ask for a result of each value; return whether it was computed."""
    computed = []
    for value in values:
        calls: list[int] = []
        inputs = (np.full(4, value),)
        assert (
            memo.get(inputs, lambda value=value, calls=calls: calls.append(value) or 10 * value) == 10 * value
        )
        computed.append(bool(calls))
    return computed


@pytest.mark.parametrize(
    ("results", "expected"),
    [
        pytest.param(1, [True, True, True, True, False], id="one"),
        pytest.param(2, [True, True, False, False, False], id="two"),
    ],
)
def test_as_many_results_are_stored_as_asked_for(results, expected):
    assert made(Memo(results=results), [1, 2, 1, 2, 2]) == expected


def test_the_oldest_result_is_dropped_first():
    assert made(Memo(results=2), [1, 2, 3, 2, 3, 1]) == [True, True, True, False, False, True]


def test_long_inputs_are_not_stored():
    assert made(Memo(max_bytes=8, results=2), [1, 1]) == [True, True]
