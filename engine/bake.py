"""The bake: the paper's algorithm from patch list to lightmap, as a generator of progress."""

from __future__ import annotations

from collections.abc import Callable, Generator
from functools import partial
from typing import TypeVar

import numpy as np

from .clock import Stopwatch
from .device.compute import Compute
from .device.graphics import Graphics
from .finish.store import LightmapStore
from .gather import Gather, choose_gather
from .lightmap import Lightmap, Report
from .limits import check_limits
from .occluders import place_occluders
from .outputs import Outputs
from .progress import Progress
from .sampled import SampledLight
from .scene import Scene, check_scene
from .settings import Settings, check_settings
from .solve import Jacobi
from .subdivision import subdivide
from .without_opencl import open_compute

Made = TypeVar("Made")


def bake(scene: Scene, settings: Settings) -> Generator[Progress, None, Lightmap]:
    """Bake the lightmaps of a scene; yields after every slice of work, returns the Lightmap.

    Closing the generator cancels the bake; every GPU object is released in any case. Raises
    SettingsError, SceneError, PatchFileError or DeviceError.
    """
    check_settings(settings)
    check_scene(scene)
    atlases, scene = scene.atlases, place_occluders(scene, settings.resolution)
    clock = Stopwatch()
    graphics = Graphics()
    try:
        compute, settings, notes = open_compute(graphics, scene, settings)
        check_limits(graphics, compute, scene, settings)
        clock.lap("devices")
        yield Progress("patches", 0.0)

        # Texture space subdivision: which texels are patches, and where they are (III.A, IV.A).
        parts = subdivide(graphics, scene, settings)
        store = LightmapStore(parts.patches, len(atlases), settings.dilation)
        clock.lap("patches")
        yield Progress("patches", 1.0)

        # Lamps, small bright surfaces and bright sky are sampled with shadow rays (direct light).
        sampled = SampledLight(compute, scene, parts, settings)
        direct = yield from _report(sampled.gather(), partial(Progress, "direct"))
        clock.lap("direct")

        # Hemicubes are drawn and integrated until the light has settled (III.B, IV.B, IV.C).
        glow, sky = sampled.emission_left, sampled.sky_left
        gather = choose_gather(graphics, compute, scene, parts, glow, sky, settings)
        glowing = bool(glow.any() or sky.any())
        solution = Jacobi(parts.surfaces.reflectance, glow, parts.geometry.area, settings, direct, glowing)
        outputs, covered = Outputs(scene, settings, sampled), sampled.covered()
        while not outputs.done(solution):
            gathered = yield from _report(gather.iteration(solution.radiance), partial(_progress, solution))
            solution.update(gathered[:, :3])
            store.hide(np.where(covered, 0, gathered[:, 3]))
            yield _progress(solution, 1.0, store.display(outputs.light(solution)))
        clock.lap("hemicubes")

        # What was asked for, as images.
        made = yield from _report(outputs.make(solution), partial(Progress, "outputs"))
        passes = {name: store.display(values) for name, values in made.items()}
        first = next(iter(made))
        clock.lap("outputs")
        warnings = (*notes, *parts.warnings, *sampled.warnings)
        report = _summary(solution, outputs, gather, len(parts.patches), clock, (graphics, compute), warnings)
        return Lightmap(atlases, store.image(made[first]), passes[first], store.covered, report, passes)
    finally:
        graphics.release()


def _report(
    work: Generator[float, None, Made], progress: Callable[[float], Progress]
) -> Generator[Progress, None, Made]:
    """Turn the fractions of a stage into progress; return what the stage made."""
    while True:
        try:
            fraction = next(work)
        except StopIteration as stop:
            made: Made = stop.value
            return made
        yield progress(fraction)


def _progress(solution: Jacobi, fraction: float, image: np.ndarray | None = None) -> Progress:
    energy = solution.energies[-1] if solution.energies else 0.0
    return Progress("hemicubes", fraction, solution.iterations, solution.residual, energy, image)


def _summary(
    solution: Jacobi,
    outputs: Outputs,
    gather: Gather,
    patches: int,
    clock: Stopwatch,
    devices: tuple[Graphics, Compute | None],
    warnings: tuple[str, ...],
) -> Report:
    graphics, compute = devices
    return Report(
        patches=patches,
        method=gather.method,
        iterations=solution.iterations,
        residual=solution.residual,
        converged=solution.converged or not outputs.bounces,
        energies=tuple(solution.energies),
        seconds=clock.laps,
        devices={"gl": graphics.name} | ({"cl": compute.name} if compute else {}),
        warnings=warnings,
        integrator=gather.integrator,
    )
