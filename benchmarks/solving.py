"""The solver of `engine.bake` without the rest of a bake, for timing."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from engine import Scene, Settings
from engine.device.cl_device import ComputeDevice
from engine.device.gl_context import GraphicsContext
from engine.direct.sky import unsampled_sky
from engine.patches.patch_scene import make_patch_scene
from engine.plan.choose_solver import choose_solver
from engine.plan.solve_job import SolveJob
from engine.solve.solver import Solver
from engine.visibility.rays.ray_scene import RayScene

#: A first part of an iteration that is not timed: shaders and kernels are built in it, s.
_WARM_UP = 1.0


@contextmanager
def solving(scene: Scene, settings: Settings, compute: ComputeDevice | None = None) -> Iterator[tuple]:
    """Yield a solver, its choice, and the number of patches; all emitters are visible to the patches."""
    with solve_job(scene, settings, compute) as job:
        yield *choose_solver(job)[:2], job.count


@contextmanager
def solve_job(scene: Scene, settings: Settings, compute: ComputeDevice | None = None) -> Iterator[SolveJob]:
    """Yield a job for a solver; all emitters are visible to the patches."""
    graphics = GraphicsContext()
    try:
        compute = compute or ComputeDevice()
        patch_scene = make_patch_scene(graphics, compute, scene, settings)
        emission, sky, rays = (
            patch_scene.surfaces.emission,
            unsampled_sky(scene.world),
            RayScene(compute, patch_scene),
        )
        dark = np.zeros_like(emission)
        area = patch_scene.geometry.area
        yield SolveJob(graphics, compute, patch_scene, rays, emission, sky, dark, area, settings)
    finally:
        graphics.release()


@dataclass(frozen=True)
class Timing:
    """Time of an iteration.

    seconds:     mean of the iterations
    iterations:  how many were timed
    fraction:    of the patches that were gathered; less than 1 if the time was up
    """

    seconds: float
    iterations: int
    fraction: float


def warm_up(solver: Solver) -> None:
    """Iterate for a moment; a kept visibility is not complete afterwards."""
    started = time.perf_counter()
    work = solver.iteration()
    for _ in work:
        if time.perf_counter() - started > _WARM_UP:
            break
    work.close()


def time_iterations(solver: Solver, iterations: int, budget: float) -> Timing:
    """Time some iterations, fewer if the budget in seconds is used up; at least a part of one."""
    started = time.perf_counter()
    for done in range(iterations):
        for fraction in solver.iteration():
            passed = time.perf_counter() - started
            if passed > budget and done == 0 and fraction < 1:
                return Timing(passed / fraction, 1, fraction)
        passed = time.perf_counter() - started
        if passed * (done + 2) / (done + 1) > budget:
            break
    return Timing(passed / (done + 1), done + 1, 1.0)
