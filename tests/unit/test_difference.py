"""Figures of a comparison count texels by their weight, without the noise of the reference."""

import numpy as np
import pytest

from tools.verification.difference import compare


def test_errors_count_by_weight_and_noise_does_not():
    rng = np.random.default_rng(3)
    shape = (1, 61, 67, 3)
    truth, noise = np.full(shape, 2.0), 0.1 * rng.standard_normal((2, *shape))
    weight = np.ones(shape, np.float32)
    weight[:, :, 40:], weight[:, 50:] = 0.25, 0
    off = np.where(np.arange(67)[:, None] < 40, 0.02, 0.2)
    bakes = [np.concatenate([truth + each, np.ones((*shape[:3], 1))], axis=-1) for each in noise]
    known = np.ones(shape[:3], bool)
    known[:, :3] = False
    figures, _ = compare(truth + off, known, weight, tuple(bakes))
    expected = np.average([0.02**2, 0.2**2], weights=[40, 27 / 4]) ** 0.5 / 2
    assert figures.rmse == pytest.approx(expected, rel=0.1)
    assert figures.bias == pytest.approx(np.average([0.02, 0.2], weights=[40, 27 / 4]) / 2, rel=0.1)
    assert figures.noise == pytest.approx(0.1 / 2**0.5 / 2, rel=0.03)
    assert figures.texels == 47 * 67 and figures.hidden == 14 * 67


def test_an_error_counts_relative_to_bright_light():
    """A glow 50 times the mean, off by 4 %, is 4 % off locally; dark texels count relative to the mean."""
    rng = np.random.default_rng(5)
    shape = (2, 31, 37, 3)
    truth = np.ones(shape)
    truth[0, 7:9, 11:13], truth[1] = 50, 0.01
    noise = 1e-3 * rng.standard_normal((2, *shape))
    bakes = [np.concatenate([truth + each, np.ones((*shape[:3], 1))], axis=-1) for each in noise]
    ours = np.where(truth > 1, 0.96 * truth, truth)
    figures, _ = compare(ours, np.ones(shape[:3], bool), np.ones(shape, np.float32), tuple(bakes))
    count, bright, mean = 2 * 31 * 37, 4, truth.mean()
    assert figures.rmse == pytest.approx((bright / count) ** 0.5 * 2 / mean, rel=1e-2)
    assert figures.local == pytest.approx((bright / count) ** 0.5 * 0.04, rel=2e-2)
