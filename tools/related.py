"""Compares related methods with Hemibake in a room with a panel and a light: error over time.

Progressive shooting (Cohen et al. 1988; Coombe, Harris and Lastra 2004) on kept visibility, instant radiosity
(Keller 1997), the paper's iteration and Hemibake's. Writes the picture and, beside it, the figures as JSON.

    python tools/related.py [--resolution 48] [--hemicube 32] [--out docs/design/paper/related.png]
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
import pyopencl as cl

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.rooms import panel_box
from engine import Settings
from engine.device.cl_device import ComputeDevice
from engine.device.gl_context import GraphicsContext
from engine.direct.sky import unsampled_sky
from engine.patches.patch_scene import PatchScene, make_patch_scene
from engine.plan.choose_solver import choose_solver
from engine.plan.solve_job import SolveJob
from engine.visibility.rays.ray_sampler import RaySampler
from engine.visibility.rays.ray_scene import RayScene
from engine.visibility.sampler import VisibilityBuffers
from engine.visibility.views.viewpoints import viewpoints
from tests.analytic.drive import drive, irradiance
from tests.reference.instant_radiosity import InstantRadiosity
from tests.reference.shooting import Shooting


@dataclass
class Curve:
    """One method; a point for each estimate.

    seconds:  since the start, visibility included
    views:    hemicubes that were summed or shot through, or lights whose shadows were cast, per patch
    error:    mean |E - E_true| over patches and channels, fraction of mean E_true
    """

    name: str
    seconds: list[float] = field(default_factory=list)
    views: list[float] = field(default_factory=list)
    error: list[float] = field(default_factory=list)


class Room:
    """Room with the form factors of its patches, and nearly exact light."""

    def __init__(self, graphics: GraphicsContext, compute: ComputeDevice, settings: Settings) -> None:
        self.graphics, self.compute, self.settings = graphics, compute, settings
        self.scene = panel_box(settings.resolution)
        self.patch_scene: PatchScene = make_patch_scene(graphics, compute, self.scene, settings)
        self.rays = RayScene(compute, self.patch_scene)
        self.polygon = np.concatenate([mesh.face for mesh in self.scene.meshes])
        self._truth = irradiance(drive(self.scene, _truth_settings(settings.resolution)))

    def error(self, light: np.ndarray) -> float:
        """Return the error of E/pi relative to the nearly exact light; see `Curve`."""
        return float(np.abs(light - self._truth).mean() / self._truth.mean())

    def job(self, settings: Settings) -> SolveJob:
        """Return the radiosity equation of the room."""
        emission, area = self.patch_scene.surfaces.emission, self.patch_scene.geometry.area
        dark, sky = np.zeros_like(emission), unsampled_sky(self.scene.world)
        return SolveJob(
            self.graphics, self.compute, self.patch_scene, self.rays, emission, sky, dark, area, settings
        )

    def seen(self) -> np.ndarray:
        """Return the patch + 1 in every texel of every patch's hemicube, (n, 3 N N)."""
        job, count = self.job(self.settings), len(self.patch_scene.patches)
        identity = RaySampler(self.compute, self.rays, self.patch_scene, job.background, self.settings)
        cache, light, part, backs = (
            cl.Buffer(self.compute.context, cl.mem_flags.READ_WRITE, size * (count + 1))
            for size in (identity.row_bytes, 16, 4, 1)
        )
        for _ in identity.find(0, count, VisibilityBuffers(cache, 0, light, part, backs)):
            pass
        size = identity.row_bytes // identity.samples
        seen = np.empty((count, identity.samples), np.uint16 if size == 2 else np.uint32)
        cl.enqueue_copy(self.compute.queue, seen, cache)
        return seen


def main() -> None:
    """Solve, compare, draw."""
    options = _options()
    settings = Settings(
        resolution=options.resolution, hemicube=options.hemicube, visibility="rays",
        directions="hemicube", method="cached", sample_emission=False, max_bounces=40, tolerance=0,
    )  # fmt: skip
    graphics = GraphicsContext()
    try:
        room = Room(graphics, ComputeDevice(), settings)
        room.seen()
        curves = [
            _gathered(room, "Hemibake: gathered, accelerated", settings),
            _gathered(room, "the paper's iteration, kept views", replace(settings, accelerate=False)),
            *_shot(room),
            _virtual_lights(room, options.particles),
        ]
    finally:
        graphics.release()
    for curve in curves:
        print(f"{curve.name}: {curve.error[-1]:.2%} after {curve.seconds[-1]:.2f} s")
    _write(curves, len(room.patch_scene.patches), options)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--resolution", type=int, default=48)
    parser.add_argument("--hemicube", type=int, default=32)
    parser.add_argument("--particles", type=int, default=400)
    parser.add_argument("--out", type=Path, default=Path("docs/design/paper/related.png"))
    return parser.parse_args()


def _truth_settings(resolution: int) -> Settings:
    """Return settings of a bake that is nearly true: direct light in closed form, four times the rays."""
    return Settings(
        resolution=resolution, visibility="rays", samples=8192, seed=1, texel_samples=1, max_bounces=40,
        tolerance=1e-5, intermediates=False,
    )  # fmt: skip


def _gathered(room: Room, name: str, settings: Settings) -> Curve:
    """Iterate; the first iteration computes visibility."""
    solution, *_ = choose_solver(room.job(settings))
    curve, watch = Curve(name), Stopwatch()
    while not solution.done:
        with watch:
            for _ in solution.iteration():
                pass
            light = solution.irradiance
        curve.seconds.append(watch.seconds)
        curve.views.append(float(solution.iterations))
        curve.error.append(room.error(light))
    return curve


def _shot(room: Room) -> list[Curve]:
    """Shoot until 0.01 % of the light is left, without and with the ambient term."""
    watch, surfaces, geometry = Stopwatch(), room.patch_scene.surfaces, room.patch_scene.geometry
    with watch:
        seen, points = room.seen(), viewpoints(room.patch_scene.triangles, geometry, room.settings)
        polygon = room.polygon[geometry.triangle]
        shooting = Shooting(
            geometry, seen, points, polygon, surfaces.emission, np.asarray(surfaces.reflectance)
        )
    plain, ambient = Curve("progressive shooting"), Curve("progressive shooting + ambient")
    start = shooting.unshot.sum()
    while shooting.unshot.sum() > 1e-4 * start:
        with watch:
            for _ in range(max(1, shooting.shots // 12)):
                shooting.shoot()
        for curve, more in ((plain, 0.0), (ambient, shooting.ambient)):
            curve.seconds.append(watch.seconds)
            curve.views.append(shooting.shots / len(seen))
            curve.error.append(room.error(shooting.irradiance + more))
    return [plain, ambient]


def _virtual_lights(room: Room, particles: int) -> Curve:
    """Add up virtual point lights; nearer than a texel's width they count as so far away."""
    triangles, geometry = room.patch_scene.triangles, room.patch_scene.geometry
    emission, reflectance = (
        np.stack([getattr(material, name) for material in room.scene.materials])[triangles.material]
        for name in ("emission", "reflectance")
    )
    nearest = float(np.sqrt(np.median(geometry.area)))
    method = InstantRadiosity(triangles, geometry, room.polygon, emission, reflectance, nearest)
    curve, watch = Curve("instant radiosity"), Stopwatch()
    estimates: Iterator[tuple[int, np.ndarray]] = method.estimates(particles)
    for lights, light in watch.each(estimates):
        curve.seconds.append(watch.seconds)
        curve.views.append(lights / len(room.polygon[geometry.triangle]))
        curve.error.append(room.error(light))
    return curve


class Stopwatch:
    """Seconds that were spent within it."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def __enter__(self) -> None:
        self._started = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        self.seconds += time.perf_counter() - self._started

    def each(self, steps: Iterator) -> Iterator:
        """Yield the items of an iterator, and measure the time."""
        while True:
            with self:
                step = next(steps, None)
            if step is None:
                return
            yield step


def _write(curves: list[Curve], patches: int, options: argparse.Namespace) -> None:
    """Write the graphs, and the figures as JSON beside them."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (over_time, over_views) = pyplot.subplots(
        1, 2, figsize=(10.5, 4.3), sharey=True, layout="constrained"
    )
    across: list[tuple] = [
        (over_time, "seconds", "seconds, visibility included"),
        (over_views, "views", "views used for each patch"),
    ]
    for axes, name, label in across:
        for curve in curves:
            axes.loglog(getattr(curve, name), 100 * np.array(curve.error), ".-", ms=3, lw=1, label=curve.name)
        axes.set_xlabel(label)
        axes.grid(which="both", alpha=0.2)
    over_time.set_ylabel("mean difference of E/π to a bake with 8,192 rays a patch\n(% of the mean)")
    over_views.legend(fontsize=8)
    figure.suptitle(f"Room with a panel, a light in its ceiling, {patches:,} patches, N = {options.hemicube}")
    figure.savefig(options.out, dpi=110)
    pyplot.close(figure)
    figures = [
        {name: _rounded(value) if isinstance(value, list) else value for name, value in asdict(curve).items()}
        for curve in curves
    ]
    data = {"patches": patches, "hemicube": options.hemicube, "curves": figures}
    options.out.with_suffix(".json").write_text(json.dumps(data) + "\n", encoding="utf-8")


def _rounded(values: list[float]) -> list[float]:
    return [float(f"{value:.5g}") for value in values]


if __name__ == "__main__":
    main()
