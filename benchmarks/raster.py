"""Measures drawing of hemicubes by each draw path, with and without culling, and their integration.

    PYTHONPATH=. python benchmarks/raster.py [--seconds S] [--widths 32,64] [--triangles 24,1008]

The scenes are a closed room with boxes in it, 12 triangles each; the hemicubes stand on walls and boxes.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from engine.device.cl_device import ComputeDevice
from engine.device.gl_context import GraphicsContext
from engine.device.slice_limits import drawing_limits
from engine.device.time_slicer import TimeSlicer
from engine.errors import DeviceError
from engine.gather.glsl_integrator import GlslIntegrator
from engine.gather.hemicube_gather import Integrator
from engine.gather.opencl_integrator import CopiedIntegrator
from engine.scene.cutouts import read_cutouts
from engine.scene.model import Scene
from engine.scene.triangles import Triangles, join_meshes
from engine.settings import Settings
from engine.visibility.raster.draw_paths import available_paths
from engine.visibility.raster.raster import HemicubeRaster
from engine.visibility.raster.targets import RadianceTarget
from engine.visibility.raster.tiles import COPIED_RADIANCE_BYTES, RADIANCE_BYTES, Tiles, plan_tiles
from engine.visibility.views.hemicube import frames, matrices, rotations
from tests.analytic.scenes import material, quads, room_walls

#: Hemicubes of an iteration: the patches of the paper's scene.
ITERATION = 10700

#: Width of the lightmap, texels; each is a patch.
LIGHTMAP = 64


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=0.5, help="time of each measurement")
    parser.add_argument("--widths", default="32,64,128", help="hemicube widths N")
    parser.add_argument("--triangles", default="24,1008,10008", help="sizes of the scenes")
    options = parser.parse_args()
    graphics, compute = GraphicsContext(), opencl()
    print(f"OpenGL: {graphics.name}; OpenCL: {compute.name if compute else 'none'}")
    for count in map(int, options.triangles.split(",")):
        for n in map(int, options.widths.split(",")):
            drawing(graphics, n, boxes(count), options.seconds)
    for n in map(int, options.widths.split(",")):
        integrating(graphics, compute, n, boxes(24), options.seconds)


def opencl() -> ComputeDevice | None:
    try:
        return ComputeDevice()
    except DeviceError as error:
        print(error)
        return None


def boxes(triangles: int) -> Scene:
    """Return a closed room of 4 x 4 x 3 m with boxes in it; `triangles` of them, a multiple of 12 from 24."""
    random = np.random.default_rng(7)
    shells = [room_walls(4, 4, 3)]
    width = 1.5 / max(1.0, (triangles / 12 - 1) ** (1 / 3))
    for _ in range(triangles // 12 - 1):
        corner = random.uniform((0.1, 0.1, 0.1), (3.9 - width, 3.9 - width, 2.9 - width))
        shells.append(room_walls(width, width, width)[:, ::-1] + corner)
    corners = np.concatenate(shells)
    charts = [(index % LIGHTMAP, index // LIGHTMAP % LIGHTMAP, 1, 1) for index in range(len(corners))]
    mesh = quads(corners, charts, [0] * len(corners), LIGHTMAP)
    return Scene((mesh,), (material("Grey", 0.5, 1.0),))


class Case:
    """A scene, a batch of hemicubes on its surfaces and the target that they are drawn into."""

    def __init__(
        self, graphics: GraphicsContext, n: int, scene: Scene, texel_bytes: int = RADIANCE_BYTES
    ) -> None:
        self.graphics, self.scene, self.triangles = graphics, scene, join_meshes(scene)
        self.tiles: Tiles = plan_tiles(Settings(hemicube=n), ITERATION, texel_bytes)
        patches = LIGHTMAP**2
        nothing = (0, 0, 0, 1) if texel_bytes == COPIED_RADIANCE_BYTES else None
        self.target = RadianceTarget(graphics, self.tiles, np.zeros((patches, 3), np.float32), nothing)
        self.target.set_radiance(np.random.default_rng(1).random((patches, 3), np.float32))
        self.frame, self.eye = viewpoints(self.triangles, self.tiles.capacity)
        horizon = np.broadcast_to([0, 0, 1], (len(self.eye), 1, 3))
        self.frames = np.concatenate([self.frame, horizon], axis=1).astype(np.float32)

    def raster(self, path: str | None = None, culling: bool = True) -> HemicubeRaster:
        """Return the hemicube raster of the scene, with a rendering path and optional culling."""
        texel_to_patch = np.arange(LIGHTMAP**2, dtype=np.uint32).reshape(1, LIGHTMAP, LIGHTMAP)
        cutouts = read_cutouts(self.scene)
        return HemicubeRaster(
            self.graphics, self.tiles, self.triangles, cutouts, texel_to_patch, self.target, path, culling
        )

    def draw(self, raster: HemicubeRaster) -> None:
        """Draw the batch once."""
        near = np.full(len(self.eye), 1e-5)
        views = matrices(self.frame, self.eye, near, self.graphics.reversed_depth)
        for _ in raster.draw(views, TimeSlicer(drawing_limits(self.tiles.capacity))):
            pass


def viewpoints(triangles: Triangles, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return frames (m, 3, 3) and eyes (m, 3) of patches spread evenly over all surfaces."""
    random, corners = np.random.default_rng(2), triangles.positions.astype(np.float64)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    chosen = random.choice(len(corners), count, p=areas / areas.sum())
    normal = triangles.normals[chosen, 0].astype(np.float64)
    weights = random.dirichlet((1, 1, 1), count)
    eye = np.einsum("nk,nkd->nd", weights, corners[chosen]) + 1e-4 * normal
    return frames(normal, rotations(0, np.arange(count))), eye


def drawing(graphics: GraphicsContext, n: int, scene: Scene, seconds: float) -> None:
    """Print hemicubes a second of every way to draw."""
    case = Case(graphics, n, scene)
    for path in available_paths(graphics):
        for culling in (True, False):
            raster = case.raster(path, culling)
            rate = case.tiles.capacity / quickest(partial(case.draw, raster), seconds)
            how = "culling" if culling else "all"
            print(f"draw N={n:3} {len(case.triangles.positions):6} triangles {path:8} {how:7} {rate:9,.0f}/s")
    raster = case.raster()
    case.draw(raster)
    print(f"     taken: {raster.path}")
    case.target.texture.release()


def integrating(
    graphics: GraphicsContext, compute: ComputeDevice | None, n: int, scene: Scene, seconds: float
) -> None:
    """Print the times of an iteration of the method `paper` with each integrator."""
    names = [*(["glsl"] if graphics.computes else []), *(["opencl"] if compute else [])]
    for name in names:
        case = Case(graphics, n, scene, RADIANCE_BYTES if name == "glsl" else COPIED_RADIANCE_BYTES)
        raster = case.raster()
        integrator = made(name, case, raster, compute)
        drawn = quickest(partial(case.draw, raster), seconds)
        summed = quickest(partial(integrator.integrate, case.frames), seconds)
        batches = 1e3 * ITERATION / case.tiles.capacity
        print(
            f"iteration N={n:3} {ITERATION} hemicubes {name:6} {batches * (drawn + summed):9,.1f} ms, "
            f"of them summing {batches * summed:9,.1f} ms; {case.tiles.capacity} a batch"
        )
        case.target.texture.release()


def made(name: str, case: Case, raster: HemicubeRaster, compute: ComputeDevice | None) -> Integrator:
    if name == "glsl" or compute is None:
        sky = np.zeros((1, 1, 3), np.float32)
        return GlslIntegrator(case.graphics, case.tiles, case.target.texture, raster.depth, sky)
    return CopiedIntegrator(compute, case.tiles, case.target.texture, np.zeros((1, 1, 3), np.float32))


def quickest(work: Callable[[], Any], seconds: float) -> float:
    """Return the least time of runs that together take `seconds`, after a first one that does not count."""
    work()
    times: list[float] = []
    while sum(times) < seconds:
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return min(times)


if __name__ == "__main__":
    main()
