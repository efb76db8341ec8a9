"""Draws the paper's Fig. 6 from our bakes: hemicubes 32, 64 and 128 texels wide, with and without rotation.

Under each picture stand the banding and the noise of all its patches; below, the spectra of the error on the
floor. The scene is a room with a panel and a light in its ceiling; it is compared with a bake of 8,192 rays a
patch, direct light in closed form. Writes the picture and, beside it, the figures as JSON.

    python tools/artifacts.py [--out docs/design/paper/fig6.png]
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.rooms import panel_box
from engine import Settings
from tests.analytic.drive import Prepared, drive, irradiance, prepare

RESOLUTION, WIDTHS = 72, (32, 64, 128)

#: Polygons of the room: the displayed floor, and the polygons that are not walls.
FLOOR, BACK, LIGHT = 0, 4, 14


@dataclass(frozen=True)
class Artifacts:
    """How far patches are from what they should show, standard deviation as a fraction of their light.

    banding:  what neighbours have in common
    noise:    what they do not
    """

    banding: float
    noise: float


def main() -> None:
    """Solve, bake, compare, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("docs/design/paper/fig6.png"))
    out = parser.parse_args().out
    prepared = prepare(panel_box(RESOLUTION), RESOLUTION)
    truth = _truth(prepared)
    bakes = {(n, turned): _bake(prepared, n, turned) for turned in (False, True) for n in WIDTHS}
    found = {}
    for (n, turned), light in bakes.items():
        found[n, turned] = artifacts(prepared, light, truth)
        print(f"N = {n}, {'rotated' if turned else 'not rotated'}: {found[n, turned]}")
    _draw(prepared, bakes, truth, found, out)
    rows = [{"hemicube": n, "rotated": turned, **asdict(row)} for (n, turned), row in found.items()]
    out.with_suffix(".json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


def artifacts(prepared: Prepared, light: np.ndarray, truth: np.ndarray) -> Artifacts:
    """Return banding and noise over all polygons but the light.

    light, truth:  (n,) float, E/pi of each patch

    Half the mean square of the difference between neighbours is the variance of noise; the rest of the
    variance is the covariance of neighbours: banding.
    """
    squares, steps = [], []
    for polygon in range(LIGHT):
        error = _chart(prepared, light / truth - 1, polygon)
        error = error - error.mean()
        squares.append((error**2).ravel())
        steps += [(np.diff(error, axis=axis) ** 2).ravel() / 2 for axis in (0, 1)]
    variance, noise = np.concatenate(squares).mean(), np.concatenate(steps).mean()
    return Artifacts(float(np.sqrt(max(variance - noise, 0))), float(np.sqrt(noise)))


def spectrum(error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies, cycles a texel, and the mean power of an image's error at each, about its mean."""
    power = np.abs(np.fft.fft2(error - error.mean())) ** 2 / error.size
    rows, columns = (np.fft.fftfreq(size) for size in error.shape)
    ring = np.round(np.hypot(rows[:, None], columns[None, :]) * 40).astype(int)
    sums, counts = np.bincount(ring.ravel(), power.ravel()), np.bincount(ring.ravel())
    last = 20
    return np.arange(1, last + 1) / 40, (sums / np.maximum(counts, 1))[1 : last + 1]


def _truth(prepared: Prepared) -> np.ndarray:
    """Return nearly exact light of each patch, (n,) float32: E/pi, mean of the channels."""
    settings = Settings(
        resolution=RESOLUTION, visibility="rays", samples=8192, seed=1, texel_samples=1, max_bounces=30,
        tolerance=1e-4, intermediates=False,
    )  # fmt: skip
    return irradiance(drive(prepared.scene, settings)).mean(axis=1)


def _bake(prepared: Prepared, hemicube: int, rotate: bool) -> np.ndarray:
    """Return E/pi of each patch with rasterised hemicubes, (n,) float32.

    All emitters are in the hemicubes.
    """
    settings = Settings(
        resolution=RESOLUTION, hemicube=hemicube, rotate=rotate, method="cached", visibility="raster",
        sample_emission=False, texel_samples=1, max_bounces=30, tolerance=1e-4, intermediates=False,
    )  # fmt: skip
    return irradiance(drive(prepared.scene, settings)).mean(axis=1)


def _chart(prepared: Prepared, values: np.ndarray, polygon: int) -> np.ndarray:
    """Return the patches of a polygon as an image, rows from the bottom up."""
    chosen = prepared.face == polygon
    y, x = np.divmod(prepared.patches.texel[chosen], RESOLUTION)
    image = np.zeros((np.ptp(y) + 1, np.ptp(x) + 1))
    image[y - y.min(), x - x.min()] = values[chosen]
    return image


def _draw(prepared: Prepared, bakes: dict, truth: np.ndarray, found: dict, out: Path) -> None:
    """Draw back wall and floor of each bake, the figures under it, and the spectra."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, rows = pyplot.subplots(
        3, len(WIDTHS), figsize=(9.6, 13.4), layout="constrained", height_ratios=(2, 2, 0.9)
    )
    white = np.quantile(truth, 0.97)
    for row, turned in zip(rows[:2], (False, True), strict=True):
        for axes, n in zip(row, WIDTHS, strict=True):
            light, figures = bakes[n, turned], found[n, turned]
            room = np.concatenate([_chart(prepared, light, face) for face in (FLOOR, BACK)])
            axes.imshow((room / white).clip(0, 1) ** (1 / 2.2), cmap="gray", origin="lower", vmin=0, vmax=1)
            axes.set_title(
                f"{n} × {n} × {n // 2}, {'random rotation' if turned else 'no rotation'}", fontsize=10
            )
            axes.set_xlabel(f"banding {figures.banding:.2%}, noise {figures.noise:.2%}", fontsize=10)
            axes.set_xticks([])
            axes.set_yticks([])
    for axes, n in zip(rows[2], WIDTHS, strict=True):
        for turned, name in ((False, "no rotation"), (True, "random rotation")):
            axes.semilogy(*spectrum(_chart(prepared, bakes[n, turned] / truth - 1, FLOOR)), label=name)
        axes.set_xlabel("cycles a texel", fontsize=9)
        axes.set_ylim(1e-6, 1e-1)
        axes.grid(alpha=0.25)
    rows[2, 0].set_ylabel("power of the error on the floor", fontsize=9)
    rows[2, 0].legend(fontsize=8)
    figure.savefig(out, dpi=75)
    pyplot.close(figure)


if __name__ == "__main__":
    main()
