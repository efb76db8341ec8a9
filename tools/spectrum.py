"""Draws the frequency spectrum of the noise of a lightmap.

A floor of 240 x 240 texels under an uneven sky, 16 rays a texel, no light sampled apart: every texel sees the
same, so that all that differs is noise. The spectrum is the mean over rings of frequencies of its power, in
parts of that of white noise with the same variance; also drawn is the noise itself, beside it shuffled.

    python tools/spectrum.py [--samples 16] [--out docs/design/quality/spectrum.png]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from engine import Settings, bake
from engine.progress import finished
from tests.analytic.test_sky_and_cutouts import sky
from tests.gpu.test_view_spread import floor

_SIZE = 240

#: Rings of frequencies up to half a cycle a texel, and texels of the noise that are shown.
_RINGS, _SHOWN = 30, 64


def main() -> None:
    """Bake, transform, draw; print the power of the lowest, the middle and the highest frequencies."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=16, help="rays of each texel")
    parser.add_argument("--out", type=Path, default=Path("out/spectrum.png"))
    options = parser.parse_args()
    noise = _noise(options.samples)
    shuffled = np.random.default_rng(1).permutation(noise.ravel()).reshape(noise.shape)
    frequencies, power = _spectrum(noise)
    for low, high in ((0, 0.125), (0.125, 0.3), (0.3, 0.5)):
        chosen = (frequencies >= low) & (frequencies < high)
        print(f"{low} to {high} cycles a texel: {power[chosen].mean():.2f} of white noise")
    _draw(options.out, noise, shuffled, (frequencies, power, _spectrum(shuffled)[1]))


def _noise(samples: int) -> np.ndarray:
    """Return the light of the floor less its mean, relative to that."""
    x, y = np.array([1.0, 0.3, 0]), np.array([0, 1.0, 0])
    world = sky(64, lambda direction: 1 + np.sin(5 * direction @ x) + (direction @ y > 0.2))
    settings = Settings(
        resolution=256, visibility="rays", samples=samples, sample_emission=False, hide_seams=False
    )
    lightmap = finished(bake(floor(256, _SIZE, world), settings))
    light = lightmap.image[0, 2 : 2 + _SIZE, 3 : 3 + _SIZE, 0].astype(np.float64)
    noise: np.ndarray = light / light.mean() - 1
    return noise


def _spectrum(noise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies, cycles a texel, and the power of each in parts of white noise's."""
    power = np.abs(np.fft.fft2(noise)) ** 2 / (noise.size * noise.var())
    axis = np.fft.fftfreq(len(noise))
    ring = np.hypot(axis[:, None], axis[None]) * 2 * _RINGS
    number = np.clip(ring.astype(int), 0, _RINGS).ravel()
    counts = np.bincount(number, minlength=_RINGS + 1)[:_RINGS]
    sums = np.bincount(number, power.ravel(), minlength=_RINGS + 1)[:_RINGS]
    return (np.arange(_RINGS) + 0.5) / (2 * _RINGS), sums / counts


def _draw(path: Path, noise: np.ndarray, shuffled: np.ndarray, curves: tuple[np.ndarray, ...]) -> None:
    """Draw both noises and both spectra side by side."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (left, middle, right) = pyplot.subplots(1, 3, figsize=(12, 4), layout="constrained")
    reach = 3 * noise.std()
    for axes, values, title in ((left, noise, "noise"), (middle, shuffled, "shuffled: white noise")):
        axes.imshow(values[:_SHOWN, :_SHOWN], cmap="gray", vmin=-reach, vmax=reach)
        axes.set_title(title)
        axes.set_axis_off()
    frequencies, power, white = curves
    right.plot(frequencies, power, label="noise")
    right.plot(frequencies, white, label="shuffled")
    right.set_xlabel("cycles a texel")
    right.set_ylabel("power, of white noise")
    right.legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)


if __name__ == "__main__":
    main()
