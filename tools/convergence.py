"""Draws the paper's Fig. 4: difference of each iteration from the full-matrix Gauss-Seidel solution.

The scene is the nine-quad room of the tests: 10,700 patches in a 128-texel lightmap. Writes the
picture and, beside it, the figures as JSON.

    python tools/convergence.py [--hemicubes 32 64 128] [--iterations 30]
                                [--out docs/design/paper/convergence.png]
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from engine import Settings
from engine.device.cl_device import ComputeDevice
from engine.device.gl_context import GraphicsContext
from engine.direct.sky import unsampled_sky
from engine.gather.hemicube_gather import PaperGather
from engine.patches.patch_materials import PatchMaterials
from engine.patches.patch_scene import PatchScene
from engine.scene.cutouts import read_cutouts
from engine.solve.host_radiosity import HostRadiosity
from engine.solve.radiosity_state import SolvedSurfaces, StartLight
from engine.solve.solver import Solver
from tests.analytic.drive import Prepared, prepare
from tests.analytic.scenes import nine_quad_room
from tests.reference.cpu_patches import map_texels
from tests.reference.form_factors import form_factors
from tests.reference.gauss_seidel import gather, gauss_seidel

RESOLUTION = 128


@dataclass
class Curve:
    """One line of the graph.

    difference:  mean |E - E_gs| over patches and channels after each iteration, fraction of mean E_gs
    seconds:     of all iterations
    """

    hemicube: int
    difference: list[float] = field(default_factory=list)
    seconds: float = 0.0


def main() -> None:
    """Solve, bake, compare, draw."""
    options = _options()
    prepared = prepare(nine_quad_room(), RESOLUTION)
    started = time.perf_counter()
    factors = form_factors(prepared.geometry, prepared.scene)
    radiance, sweeps = gauss_seidel(factors, prepared.emission, prepared.reflectance)
    truth = gather(factors, radiance, prepared.emission)
    print(f"Gauss-Seidel: {sweeps} sweeps, {time.perf_counter() - started:.0f} s")

    curves = []
    for hemicube in options.hemicubes:
        curves.append(_curve(prepared, truth, hemicube, options.iterations))
        last = curves[-1].difference[-1]
        print(f"N = {hemicube}: {last:.3%} after {options.iterations} iterations, {curves[-1].seconds:.0f} s")
        _write(curves, sweeps, len(truth), options.out)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hemicubes", type=int, nargs="+", default=[32, 64, 128])
    parser.add_argument("--iterations", type=int, default=30)
    parser.add_argument("--out", type=Path, default=Path("docs/design/paper/convergence.png"))
    return parser.parse_args()


def _curve(prepared: Prepared, truth: np.ndarray, hemicube: int, iterations: int) -> Curve:
    """Bake the room and compare every iteration with the truth."""
    curve, started = Curve(hemicube), time.perf_counter()
    settings = Settings(resolution=RESOLUTION, hemicube=hemicube, max_bounces=iterations, tolerance=0)
    for irradiance in _iterations(prepared, settings):
        curve.difference.append(float(np.abs(irradiance - truth).mean() / truth.mean()))
    curve.seconds = round(time.perf_counter() - started, 1)
    return curve


def _iterations(prepared: Prepared, settings: Settings) -> Iterator[np.ndarray]:
    """Yield E/pi of every patch after each iteration of the paper's method, (n, 3) float32."""
    graphics = GraphicsContext()
    try:
        surfaces = PatchMaterials(prepared.reflectance, prepared.emission)
        texels = map_texels(prepared.scene, prepared.patches)
        cutouts, triangles = read_cutouts(prepared.scene), prepared.triangles
        patch_scene = PatchScene(
            triangles, cutouts, prepared.patches, prepared.geometry, surfaces, texels, ()
        )
        sky = unsampled_sky(prepared.scene.world)
        paper = PaperGather(graphics, ComputeDevice(), patch_scene, prepared.emission, sky, settings)
        start = StartLight(np.zeros_like(prepared.emission))
        surfaces = SolvedSurfaces(prepared.reflectance, prepared.geometry.area)
        radiosity = HostRadiosity(paper, surfaces, prepared.emission, start)
        solution = Solver(radiosity, start, settings)
        while not solution.done:
            for _ in solution.iteration():
                pass
            yield solution.irradiance.copy()
    finally:
        graphics.release()


def _write(curves: list[Curve], sweeps: int, patches: int, picture: Path) -> None:
    """Write the graph, and the figures as JSON beside it."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7, 4.2), layout="constrained")
    for curve in curves:
        percent = 100 * np.array(curve.difference)
        axes.semilogy(
            np.arange(1, len(percent) + 1), percent, label=f"N = {curve.hemicube}: {percent[-1]:.2f} %"
        )
    axes.set_xlabel("iteration")
    axes.set_ylabel("mean difference of E/π to Gauss–Seidel\n(% of the mean)")
    axes.set_title(f"Nine-quad room, {patches:,} patches in a 128² lightmap")
    axes.grid(which="both", alpha=0.25)
    axes.legend(title="hemicube width, last value")
    figure.savefig(picture, dpi=150)
    pyplot.close(figure)
    figures = {"patches": patches, "sweeps": sweeps, "curves": [asdict(curve) for curve in curves]}
    picture.with_suffix(".json").write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
