"""Measures Elias' interpolation of hemicubes (paper, VI.A): saved hemicubes and added error.

A hemicube for every fourth texel of a chart; where the corners of a square differ by more than a tolerance,
its middle and the middles of its sides get hemicubes, and so on down to every texel; all others are
interpolated. Beside it irradiance caching with gradients (tests/reference/irradiance_caching.py), of
hemicubes of 768 texels, and Elias' interpolation of the same hemicubes. What they have to beat is what saves
as much without any code: fewer samples in every hemicube. Errors are of bakes of three rooms, against a bake
with many more samples. Writes the picture and, beside it, the figures as JSON.

    python tools/interpolation.py [--scene NAME] [--out docs/design/paper/interpolation.png]
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyopencl as cl

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.rooms import cornell_box, hilly_room
from engine import Scene, Session, Settings, finished
from engine.device.cl_device import ComputeDevice
from engine.patches.patch_scene import PatchScene
from engine.visibility.sampler import SampleLayout
from engine.visibility.views.hemicube import frames, rotations
from tests.analytic.drive import drive
from tests.analytic.scenes import nine_quad_room
from tests.reference.irradiance_caching import IrradianceCache, Records, records

#: Scenes, and the width of their lightmaps.
SCENES: dict[str, tuple[Callable[[], Scene], int]] = {
    "Cornell box": (lambda: cornell_box(80), 80),
    "nine quads": (nine_quad_room, 128),
    "hills": (lambda: hilly_room(80, 800), 80),
}

#: Kinds of light that are interpolated, and the settings that produce them.
LIGHTS: dict[str, dict] = {
    "all light, seen by hemicubes": {"sample_emission": False},
    "indirect light": {"outputs": ("indirect",)},
}

#: Samples per patch in the interpolated bake, in cheaper bakes, and in the reference.
FULL, FEWER, TRUE = 1024, (512, 256, 128, 64), 6144

#: Differences of the corners of a square that are interpolated over, as a fraction of their mean.
TOLERANCES = (0.01, 0.02, 0.04, 0.08, 0.16, 0.32)

#: Width of the hemicubes whose gradients are taken, texels: 768 samples.
WIDTH = 16

#: How the curves are drawn.
STYLES = ("k*", "s-", "o--", "r*", "d-", "x:")

#: Errors that records of irradiance serve over (Ward's a), and the reaches of records, texels.
ERRORS = (0.1, 0.15, 0.2, 0.3, 0.45)
REACHES = (1.0, 32.0)

#: Distance of the first hemicubes, texels.
STEP = 4


def main() -> None:
    """Bake and measure the scenes that were asked for, then draw all that is stored."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--scene", choices=SCENES, action="append", help="measure only this one; may be repeated"
    )
    parser.add_argument("--out", type=Path, default=Path("docs/design/paper/interpolation.png"))
    options = parser.parse_args()
    stored = options.out.with_suffix(".json")
    figures = json.loads(stored.read_text(encoding="utf-8")) if stored.exists() else {}
    for name in options.scene or SCENES:
        figures[name] = {light: _measure(*SCENES[name], more) for light, more in LIGHTS.items()}
        print(name, json.dumps(figures[name], indent=1), flush=True)
        stored.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    _draw(figures, options.out)


def interpolated(image: np.ndarray, known: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate a chart by the method of Elias; return the image, and a mask of texels with a hemicube.

    image:      (h, w) float, what a hemicube of each texel gathers; 0 where `known` is False
    known:      (h, w) bool, texels of the chart
    tolerance:  see `TOLERANCES`
    """
    rows, columns = (np.unique(np.append(np.arange(0, size, STEP), size - 1)) for size in image.shape)
    result, sampled = np.zeros_like(image), np.zeros(image.shape, bool)
    squares = [
        (rows[i], columns[j], rows[min(i + 1, len(rows) - 1)], columns[min(j + 1, len(columns) - 1)])
        for i in range(max(1, len(rows) - 1))
        for j in range(max(1, len(columns) - 1))
    ]
    while squares:
        top, left, bottom, right = squares.pop()
        corners = np.ix_([top, bottom], [left, right])
        sampled[corners] = True
        inside = (slice(top, bottom + 1), slice(left, right + 1))
        values = image[corners]
        even = np.ptp(values) <= tolerance * values.mean()
        if known[corners].all() and known[inside].all() and even:
            v, u = (np.linspace(0, 1, n)[:, None] for n in (bottom - top + 1, right - left + 1))
            across = values[:, :1] * (1 - u.T) + values[:, 1:] * u.T
            result[inside] = across[:1] * (1 - v) + across[1:] * v
        elif max(bottom - top, right - left) > 1:
            y, x = (top + bottom) // 2, (left + right) // 2
            ys, xs = sorted({top, y, bottom}), sorted({left, x, right})
            squares += [
                (a, c, b, d)
                for a, b in zip(ys, ys[1:] or ys, strict=False)
                for c, d in zip(xs, xs[1:] or xs, strict=False)
            ]
    sampled &= known
    result[sampled] = image[sampled]
    return result, sampled


def _measure(make: Callable[[], Scene], resolution: int, more: dict) -> dict[str, list]:
    """Return pairs of cost, as a part of all samples, and error, of interpolation and of fewer samples."""
    scene = make()
    settings = Settings(
        resolution=resolution, visibility="rays", texel_samples=1, max_bounces=12, tolerance=1e-3,
        samples=FULL, intermediates=False, **more,
    )  # fmt: skip
    truth, known = _bake(scene, replace(settings, samples=TRUE, seed=1))
    full, _ = _bake(scene, settings)
    found: dict[str, list] = {
        "full": [[1.0, _error(full, truth, known)]], "interpolated": [], "fewer samples": [],
    }  # fmt: skip
    chart = _charts(known)
    for tolerance in TOLERANCES:
        light, cost = _interpolated_charts(full, chart, tolerance)
        found["interpolated"].append([cost, _error(light, truth, known)])
    for samples in FEWER:
        light, _ = _bake(scene, replace(settings, samples=samples))
        found["fewer samples"].append([samples / FULL, _error(light, truth, known)])
    return found | _measure_hemicubes(scene, settings, truth, known) if settings.sample_emission else found


def _measure_hemicubes(
    scene: Scene, settings: Settings, truth: np.ndarray, known: np.ndarray
) -> dict[str, list]:
    """Return pairs of cost and error of hemicubes, of irradiance caching, and of interpolation of them."""
    light, told, patch_scene = _hemicubes(scene, settings, known)
    full = np.zeros_like(truth)
    full[known] = light
    found: dict[str, list] = {
        "hemicubes": [[1.0, _error(full, truth, known)]], "cached": [], "interpolated hemicubes": [],
    }  # fmt: skip
    chart, geometry = _charts(known), patch_scene.geometry
    for tolerance in TOLERANCES:
        image, cost = _interpolated_charts(full, chart, tolerance)
        found["interpolated hemicubes"].append([cost, _error(image, truth, known)])

    # The first records are far apart.
    row, column = np.divmod(patch_scene.patches.texel, patch_scene.patches.resolution)
    spacing = np.minimum((row | column) & -(row | column), 8)
    order = np.argsort(-np.where(row | column, spacing, 8), kind="stable")
    texel = float(np.sqrt(np.median(geometry.area)))
    for error in ERRORS:
        points, normals = geometry.center.astype(float), geometry.normal.astype(float)
        cache = IrradianceCache(points, normals, told, error, (REACHES[0] * texel, REACHES[1] * texel))
        recorded, image = cache.fill(order), np.zeros_like(truth)
        image[known] = cache.light(recorded)
        found["cached"].append([float(recorded.mean()), _error(image, truth, known)])
    return found


def _hemicubes(scene: Scene, settings: Settings, known: np.ndarray) -> tuple[np.ndarray, Records, PatchScene]:
    """Return reflected E/pi of patches by hemicubes, mean of channels, (n,), what they tell, and these."""
    session, outputs = Session(), ("direct", "indirect")
    changes = {"directions": "hemicube", "hemicube": WIDTH, "samples": 0, "outputs": outputs}
    lightmap = finished(session.bake(scene, replace(settings, **changes)))
    patch_scene, kept, compute = session._kept._patch_scene, session._kept.samples, session._devices.compute
    radiance = np.zeros((len(patch_scene.patches) + 2, 3))
    gathered = sum(lightmap.passes[name] for name in outputs)[0][known]
    radiance[1:-1] = np.asarray(patch_scene.surfaces.reflectance) * gathered
    rows = np.concatenate([_downloaded(compute, piece.cache, kept.sampling) for piece in kept.pieces])
    session.close()

    # Backs are dark, and may be near: records that see them serve nobody. All else that is no patch is far.
    seen, geometry = rows.reshape(-1, 3 * WIDTH, WIDTH), patch_scene.geometry
    places = np.full((len(radiance), 3), np.inf)
    places[1:-1] = geometry.center
    nearest = 1e-3 * np.sqrt(geometry.area)[:, None, None]
    frame = frames(geometry.normal, rotations(settings.seed, np.arange(len(seen))))
    told = []
    for some in np.array_split(np.arange(len(seen)), max(1, len(seen) // 1024)):
        distance = np.linalg.norm(places[seen[some]] - geometry.center[some][:, None, None], axis=-1)
        distance = np.where(seen[some] == 0, nearest[some], np.maximum(distance, nearest[some]))
        told.append(records(WIDTH, frame[some], radiance.mean(axis=1)[seen[some]], distance))
    joined = Records(*(np.concatenate([vars(part)[name] for part in told]) for name in vars(told[0])))
    return joined.light, joined, patch_scene


def _downloaded(compute: ComputeDevice, cache: cl.Buffer, sampling: SampleLayout) -> np.ndarray:
    """Return kept samples, (n, samples) uint16 or uint32."""
    values = np.empty(cache.size // sampling.sample_bytes, f"u{sampling.sample_bytes}")
    cl.enqueue_copy(compute.queue, values, cache)
    return values.reshape(-1, sampling.samples)


def _bake(scene: Scene, settings: Settings) -> tuple[np.ndarray, np.ndarray]:
    """Return E/pi of all texels, mean of the channels, (r, r) float32, and which are patches, (r, r) bool."""
    lightmap = drive(scene, settings)
    return lightmap.image[0].mean(axis=-1), lightmap.has_patch[0]


def _error(light: np.ndarray, truth: np.ndarray, known: np.ndarray) -> float:
    """Return the root of the mean squared error as a fraction of the mean light."""
    difference = (light - truth)[known]
    return float(np.sqrt((difference**2).mean()) / truth[known].mean())


def _interpolated_charts(light: np.ndarray, chart: np.ndarray, tolerance: float) -> tuple[np.ndarray, float]:
    """Return the light with each chart interpolated, and the part of all patches that have hemicubes."""
    result, count = np.zeros_like(light), 0
    for number in range(1, chart.max() + 1):
        y, x = np.nonzero(chart == number)
        box = (slice(y.min(), y.max() + 1), slice(x.min(), x.max() + 1))
        known = chart[box] == number
        smooth, sampled = interpolated(np.where(known, light[box], 0), known, tolerance)
        result[box][known] = smooth[known]
        count += int(sampled.sum())
    return result, count / int((chart > 0).sum())


def _charts(known: np.ndarray) -> np.ndarray:
    """Return the chart of each texel, (r, r) int, from 1 on: patches that touch, since charts lie apart."""
    label = np.arange(1, known.size + 1).reshape(known.shape) * known
    while True:
        padded = np.pad(label, 1)
        highest = np.maximum.reduce(
            [padded[1:-1, :-2], padded[1:-1, 2:], padded[:-2, 1:-1], padded[2:, 1:-1]]
        )
        grown = np.maximum(label, highest) * known
        if (grown == label).all():
            return np.unique(label, return_inverse=True)[1].reshape(known.shape)
        label = grown


def _draw(figures: dict, out: Path) -> None:
    """Draw error over cost, a panel for each scene and kind of light."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(
        len(LIGHTS), len(figures), figsize=(3.5 * len(figures), 6.2), layout="constrained", squeeze=False
    )
    for column, (scene, lights) in enumerate(figures.items()):
        for axes, (light, curves) in zip(panels[:, column], lights.items(), strict=True):
            for (name, points), style in zip(curves.items(), STYLES, strict=False):
                cost, error = 100 * np.array(points).T
                axes.plot(cost, error, style, ms=5, label=name)
            axes.set_title(f"{scene}: {light}", fontsize=8)
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_xticks([6, 12, 25, 50, 100], [6, 12, 25, 50, 100])
            axes.set_xticks([], minor=True)
            axes.yaxis.set_major_formatter("{x:g}")
            axes.yaxis.set_minor_formatter("{x:g}")
            axes.tick_params(which="both", labelsize=7)
            axes.grid(which="both", alpha=0.25)
        panels[-1, column].set_xlabel("samples, % of a full bake", fontsize=8)
    for axes in panels[:, 0]:
        axes.set_ylabel("RMSE, % of the mean", fontsize=8)
    panels[-1, 0].legend(fontsize=7)
    figure.savefig(out, dpi=90)
    pyplot.close(figure)


if __name__ == "__main__":
    main()
