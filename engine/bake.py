"""The bake: the paper's algorithm from patch list to lightmap, as a generator of progress."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from .clock import Stopwatch
from .coverage import check_overlap, note_uncovered, touched_triangles
from .device.compute import Compute
from .device.graphics import Graphics
from .finish.store import LightmapStore
from .gather import PaperGather
from .geometry import gather_triangles
from .index_map import add_thin_patches
from .lightmap import Lightmap, Report
from .limits import check_limits, check_patch_count
from .patch_file import list_or_load_patches
from .progress import Progress
from .scene import Scene, check_scene
from .settings import Settings, check_settings
from .solve import Jacobi


def bake(scene: Scene, settings: Settings) -> Generator[Progress, None, Lightmap]:
    """Bake the lightmaps of a scene; yields after every slice of work, returns the Lightmap.

    Closing the generator cancels the bake; every GPU object is released in any case. Raises
    SettingsError, SceneError, PatchFileError or DeviceError.
    """
    check_settings(settings)
    check_scene(scene)
    clock = Stopwatch()
    graphics = Graphics()
    try:
        compute = Compute(settings.cache_dir)
        check_limits(graphics, compute, scene, settings)
        clock.lap("devices")
        yield Progress("patches", 0.0)

        # Texture space subdivision: which texels are patches, and where they are (III.A, IV.A).
        triangles = gather_triangles(scene)
        covered = list_or_load_patches(graphics, scene, settings)
        warnings = [*note_uncovered(scene, covered), *check_overlap(graphics, scene, triangles, covered)]
        touched = touched_triangles(graphics, triangles, len(scene.atlases), settings.resolution)
        patches, geometry, owners = add_thin_patches(scene, triangles, covered, touched)
        check_patch_count(len(patches))
        reflectance = np.stack([material.reflectance for material in scene.materials])[geometry.material]
        emission = np.stack([material.emission for material in scene.materials])[geometry.material]
        clock.lap("patches")
        yield Progress("patches", 1.0)

        # Hemicubes are drawn and integrated until the light has settled (III.B, IV.B, IV.C).
        gather = PaperGather(
            graphics, compute, scene, triangles, patches, geometry, owners, emission, settings
        )
        solution = Jacobi(reflectance, emission, geometry.area, settings)
        store = LightmapStore(patches, len(scene.atlases), settings.dilation)
        while not solution.done:
            irradiance = yield from _report_slices(gather.iteration(solution.radiance), solution)
            solution.update(irradiance[:, :3])
            store.update(irradiance)
            yield _progress(solution, 1.0, store.display)
        clock.lap("hemicubes")

        devices = {"gl": graphics.name, "cl": compute.name}
        report = Report(
            patches=len(patches),
            iterations=solution.iterations,
            residual=solution.residual,
            converged=solution.converged,
            energies=tuple(solution.energies),
            seconds=clock.laps,
            devices=devices,
            warnings=tuple(warnings),
        )
        return Lightmap(scene.atlases, store.image, store.display, store.covered, report)
    finally:
        graphics.release()


def _report_slices(
    iteration: Generator[float, None, np.ndarray], solution: Jacobi
) -> Generator[Progress, None, np.ndarray]:
    """Turn the fractions of one iteration into progress; return what it gathered."""
    while True:
        try:
            fraction = next(iteration)
        except StopIteration as stop:
            gathered: np.ndarray = stop.value
            return gathered
        yield _progress(solution, fraction)


def _progress(solution: Jacobi, fraction: float, partial: np.ndarray | None = None) -> Progress:
    energy = solution.energies[-1] if solution.energies else 0.0
    return Progress("hemicubes", fraction, solution.iterations, solution.residual, energy, partial)
