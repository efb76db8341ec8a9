"""Selection of few maps, and their nonnegative weights."""

import numpy as np
import pytest

from engine.postprocess.map_basis import choose_maps

RNG = np.random.default_rng(38)
BASE = RNG.uniform(0, 1, (3, 1009, 3)).astype(np.float32)


def mixed(weights):
    """Return maps from BASE by weights, (n, 3)."""
    return np.einsum("nk,ksc->nsc", np.asarray(weights, np.float32), BASE)


def shown(basis, maps):
    """Return the maps that a basis represents."""
    return np.einsum("nkc,ksc->nsc", basis.weights, maps[list(basis.chosen)])


def test_mixes_of_others_are_dropped():
    maps = mixed([[0.2, 0.3, 0.5], [1, 0, 0], [0, 2, 0], [0.7, 0.1, 0], [0, 0, 3], [1, 1, 1]])
    basis = choose_maps([maps], 0.01)
    assert len(basis.chosen) == 3 and (basis.weights >= 0).all() and basis.errors.max() < 1e-3
    assert shown(basis, maps) == pytest.approx(maps, abs=1e-3)


def test_the_weights_of_a_channel_are_its_own():
    maps = np.stack([BASE[0], BASE[0] * np.array([1.0, 0.5, 0.25], np.float32)])
    basis = choose_maps([maps], 0.01)
    assert len(basis.chosen) == 1 and shown(basis, maps) == pytest.approx(maps, abs=1e-5)


def test_a_negative_mix_is_no_mix():
    """The difference of two maps would need a negative weight, so it becomes a map of the basis."""
    maps = np.stack([BASE[0] + BASE[1], BASE[1], BASE[0]])
    basis = choose_maps([maps], 0.01)
    assert basis.chosen == (1, 2) and basis.errors.max() < 1e-5
    sharp = np.stack([BASE[0] + BASE[1], BASE[1] * 0.5 + BASE[2], BASE[0] * 0.1])
    assert choose_maps([sharp], 0.0).chosen == (0, 1, 2)


@pytest.mark.parametrize("tolerance", [0.02, 0.2])
def test_errors_are_measured_as_stated(tolerance):
    """Relative to the mean of each map, also in a block that is much darker, with negative values."""
    maps = mixed(RNG.uniform(0, 1, (7, 3)))
    maps += RNG.normal(0, 0.02, maps.shape).astype(np.float32) * maps.mean(axis=(1, 2), keepdims=True)
    probes = RNG.normal(0, 1e-3, (7, 101, 3)).astype(np.float32) @ np.eye(3, dtype=np.float32)
    basis = choose_maps([maps, probes], tolerance)
    assert basis.errors.max() <= tolerance
    for number in range(7):
        errors = [
            np.sqrt(np.mean((shown(basis, block)[number] - block[number]) ** 2))
            / np.abs(block[number]).mean()
            for block in (maps, probes)
        ]
        assert basis.errors[number] == pytest.approx(max(errors), rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("count", [1, 3])
def test_black_maps_leave_one(count):
    basis = choose_maps([np.zeros((count, 5, 3), np.float32)], 0.01)
    assert basis.chosen == (0,) and not basis.errors.any()


def test_a_black_map_among_others_has_no_weight():
    maps = np.concatenate([BASE[:1] * 0, BASE[:2]])
    basis = choose_maps([maps], 0.01)
    assert basis.chosen == (1, 2) and not basis.weights[0].any()
