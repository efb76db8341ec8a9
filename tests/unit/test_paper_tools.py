"""Tests of the tools that draw the pictures of docs/design/paper.md."""

import json
from dataclasses import dataclass

import numpy as np
import pytest

from tools.artifacts import LIGHT, RESOLUTION, artifacts, spectrum
from tools.paper_figures import LAYERS, ROOT, WIDTHS, Times


@dataclass
class Texels:
    resolution: int
    texel: np.ndarray


class Charts:
    """Patches of the room's polygons: 31 x 12 texels each, one above the other."""

    def __init__(self):
        y, x = np.mgrid[: 12 * LIGHT, :31]
        self.patches = Texels(RESOLUTION, (y * RESOLUTION + x).ravel())
        self.face = (y // 12).ravel()
        self.x = x.ravel()


def found(error):
    charts = Charts()
    truth = np.linspace(1, 3, len(charts.x))
    return artifacts(charts, truth * (1 + error(charts)), truth)


def test_errors_that_neighbours_share_are_banding_and_others_noise():
    random = np.random.default_rng(1)
    noise = found(lambda charts: random.normal(0, 0.03, len(charts.x)))
    assert noise.noise == pytest.approx(0.03, rel=0.05) and noise.banding < 0.008
    bands = found(lambda charts: 0.03 * np.sqrt(2) * np.sin(2 * np.pi * charts.x / 15.5))
    assert bands.banding == pytest.approx(0.03, rel=0.07) and bands.noise < 0.01


def test_bias_is_neither():
    even = found(lambda charts: np.full(len(charts.x), 0.2))
    assert even.banding < 1e-12 and even.noise < 1e-12


def test_spectrum_of_noise_is_flat_and_that_of_bands_has_a_peak():
    random, x = np.random.default_rng(2), np.arange(64)
    _, power = spectrum(random.normal(0, 1, (64, 64)))
    assert power == pytest.approx(1, abs=0.35)
    frequency, power = spectrum(np.tile(np.sin(2 * np.pi * x / 8), (64, 1)))
    assert frequency[power.argmax()] == pytest.approx(1 / 8, abs=0.013)


def test_figures_are_those_that_are_stored():
    times = Times()
    assert times.paper("gpu", 64, 8) == 188.75 and times.paper("cpu", 32, 1) == 1108.60
    assert set(times.devices) == {"cpu", "gpu"}
    paths = sorted((ROOT / "benchmarks/results").glob("*-gpu-*.json"))
    suites = [json.loads(path.read_text(encoding="utf-8"))["suites"] for path in paths]
    *_, records = (suite["fig5"]["records"] for suite in suites if "fig5" in suite)
    for n in WIDTHS:
        drawn = [times.drawn("gpu", n, layers) for layers in LAYERS]
        assert drawn == [
            r["ms"] for r in records if (r["hemicube"], r["method"]) == (n, "paper") and r["layers"]
        ]
        assert times.kept("gpu", n)[1] < min(drawn) / 50
