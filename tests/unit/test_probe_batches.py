"""Sizes of the batches in which probes are gathered."""

import pytest

from engine.probes.gather_probes import _batch_size


@pytest.mark.parametrize(("directions", "expected"), [(60, 65_536), (4080, 7310), (65_520, 455), (10**9, 1)])
def test_samples_of_a_batch_fit_into_256_mib(directions, expected):
    assert _batch_size(directions) == expected
    assert expected == 1 or 9 * directions * expected <= 1 << 28
