"""Chooses who solves for the light of patches: every patch or groups of them, on the device or the host."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..device.device_array import colors_on_host
from ..gather.cached_gather import CachedGather
from ..gather.device_gather import DeviceGather
from ..gather.glsl_cached import fits_glsl_cache
from ..gather.hemicube_gather import GlslGather, HostGather, PaperGather
from ..scene.digests import digest_of
from ..settings import Settings
from ..solve.black_solution import BlackSolution
from ..solve.device_radiosity import DeviceRadiosity
from ..solve.final_gather import FinalGather
from ..solve.grouped_solution import GroupedSolution
from ..solve.host_radiosity import HostRadiosity
from ..solve.interpolated_gather import InterpolatedGather
from ..solve.interpolation import Interpolation
from ..solve.patch_groups import PatchGroups, SinglePatches, group_representatives, numbered
from ..solve.radiosity_state import Radiosity
from ..solve.resumed_solver import ResumedSolver
from ..solve.solution import Solution
from ..solve.solver import FindStandIns, Solver
from ..validity.thresholds import MAX_BACKS_INTERPOLATED
from ..visibility.raster.tiles import IDENTITY_BYTES, plan_tiles
from ..visibility.rays.near_openness import backs_met, openness
from ..visibility.sample_counts import ray_count
from .choose_gather import choose_sweep
from .memory import MORE_RAYS, group_width, is_adaptive, is_smoothed
from .receivers import Receivers, make_final_gather, separates_direct
from .solve_job import SolveJob
from .solver_choice import SolverChoice
from .substitute_patches import substitute_patches

#: What a plane through the light of groups may leave over, as a fraction of all light, times the root of the
#: rays of a patch. Three times the error of these: much of it is noise of the groups, which the plane takes
#: out, and where light bends the middle of the plane is nearer to it than what is left over says.
_TOLERANCE = 2.0

#: Width of the smaller squares, texels, of which one patch gathers first where groups are too coarse.
_SMALLER = 2

#: How far from patches something is near, texels: patches near things of which groups know nothing gather.
_NEAR = 2.0

#: Patches that gather for themselves, as a fraction, before it is known.
_GATHERING = 0.25


def choose_solver(job: SolveJob) -> tuple[Solution, SolverChoice, SolveJob]:
    """Return what solves a bake's light, the way that was chosen for patches to gather, and what is solved.

    That is the job itself, or that of groups of its patches.
    """
    if job.dark:
        job.kept.light = None
        why = "No light reaches any patch: nothing is looked for."
        return BlackSolution(job.count), SolverChoice("none", "none", 0, (why,)), job
    width, reasons = group_width(job)
    if width == 1:
        return *(_smoothed_solution(job) if is_smoothed(job) else _solver(job)), job
    solution, choice, squares = _grouped_solution(job, width)
    return solution, replace(choice, reasons=(*reasons, *choice.reasons)), squares


def solver_like(job: SolveJob, choice: SolverChoice, stand_in: np.ndarray | None) -> Solver:
    """Return what solves for a part of the light, with samples and stand-ins as of all of it."""
    settings = replace(job.settings, method=choice.method, visibility=choice.visibility)
    part = replace(job, settings=settings, indirect=None, direct=None, front=None)
    return _solver(part, lambda _: stand_in)[0]


def _solver(job: SolveJob, find_stand_ins: FindStandIns | None = None) -> tuple[Solver, SolverChoice]:
    """Return what solves for every patch on its own; see `Solver`."""
    if find_stand_ins is None and job.near is not None:
        find_stand_ins = partial(substitute_patches, job.parts, job.near, beside=job.kept.find_substitutes)
    radiosity, choice = _host_radiosity(job) if _by_hemicubes(job) else _device_radiosity(job)
    gathered_by = (choice.method, choice.visibility, choice.samples, choice.integrator)
    solver = ResumedSolver(
        radiosity, job.sampled_light, job.settings, job.gathers_direct, job.indirect,
        job.checkpoint, lambda: digest_of((*job.light_key, *gathered_by)), find_stand_ins, job.direct,
        job.front,
    )  # fmt: skip
    return solver, replace(choice, patches=job.count)


def _grouped_solution(job: SolveJob, width: int) -> tuple[GroupedSolution, SolverChoice, SolveJob]:
    """Return what solves for squares of patches, then gathers for each patch."""
    leader = group_representatives(job.rays, job.parts, job.first_radiance, job.kept.inside(job.rays), width)
    groups = PatchGroups(job.rays, job.parts, job.area, leader, width)
    emission = groups.mean(job.emission)
    backs = None if job.backs is None else groups.mean(job.backs)
    if job.remote is not None:
        # Other processes begin to find what groups see; the rest of them is made meanwhile.
        job.remote.of_groups(groups.leader, groups.texel_to_group, emission if backs is None else backs)
    squares = replace(
        job,
        settings=_settings_of_groups(job),
        parts=groups.parts,
        rays=groups.rays,
        emission=emission,
        backs=backs,
        sampled_light=groups.mean(job.sampled_light),
        area=groups.area,
        indirect=None if job.indirect is None else groups.mean(colors_on_host(job.indirect)),
        direct=None,
        front=None,
        near=job.near and job.near.part(groups.leader),
    )
    solver, choice = _solver(squares)
    if is_adaptive(job):
        choice = replace(choice, final_samples=int(_GATHERING * job.count * ray_count(job.settings)))
        between = _interpolated(job, squares, solver, choice, _widths(job, groups))
        return GroupedSolution(solver, groups, between), choice, squares
    receivers = Receivers(job.parts, job.rays, job.sampled_light)
    last, samples = make_final_gather(squares, choice, receivers, job.settings)
    return GroupedSolution(solver, groups, last), replace(choice, final_samples=samples), squares


def _smoothed_solution(job: SolveJob) -> tuple[GroupedSolution, SolverChoice]:
    """Return what solves for every patch; planes then take noise out of the light around each."""
    solver, choice = _solver(job)
    between = _interpolated(job, job, solver, choice, [])
    reasons = (*choice.reasons, "Where the light of patches around each lies in a plane, it has that light.")
    solution = GroupedSolution(solver, SinglePatches(job.count), between)
    return solution, replace(choice, reasons=reasons)


def _settings_of_groups(job: SolveJob) -> Settings:
    """Return the settings by which groups are solved: they give light alone.

    Where patches have it from them, they also tell where it comes from.
    """
    settings = light_alone(job.settings)
    if not is_adaptive(job):
        return settings
    outputs = settings.outputs + job.settings.directional_outputs
    return replace(settings, outputs=outputs, samples=MORE_RAYS * ray_count(settings))


def light_alone(settings: Settings) -> Settings:
    """Return the settings for light alone, without directions, occlusion and masks."""
    return replace(settings, outputs=settings.light_outputs)


#: Squares of patches: the group of each patch, the patch that leads each group, and their width, texels.
_Squares = tuple[np.ndarray, np.ndarray, int]


def _widths(job: SolveJob, groups: PatchGroups) -> list[_Squares]:
    """Return the squares that are solved as one, and smaller ones."""
    inside = job.kept.inside(job.rays)
    smaller = numbered(group_representatives(job.rays, job.parts, job.first_radiance, inside, _SMALLER))
    return [(groups.group, groups.leader, groups.width), (*smaller, _SMALLER)]


def _interpolated(
    job: SolveJob, solved: SolveJob, solver: Solver, choice: SolverChoice, widths: Sequence[_Squares]
) -> InterpolatedGather:
    """Return what gathers for the patches that differ from those around them.

    solved: patches, or the squares of them that come first in `widths`, of which `solver` tells the light
    """

    def last_of(chosen: np.ndarray) -> FinalGather:
        parts = job.parts.part(chosen)
        receivers = Receivers(parts, job.rays.of(parts), job.sampled_light[chosen])
        return make_final_gather(solved, choice, receivers, job.settings)[0]

    # Only groups know nothing of what is near the patches between them.
    opening = openness(job.rays, _NEAR) if widths else None
    backs = None if job.parts.triangles.backs is None else backs_met(job.rays) > MAX_BACKS_INTERPOLATED
    patches = np.arange(job.count)
    return InterpolatedGather(
        solver,
        [Interpolation(job.rays, job.parts, *squares, opening, backs) for squares in widths],
        Interpolation(job.rays, job.parts, patches, patches, 1, opening, backs),
        job.sampled_light,
        solved.sampled_light,
        _TOLERANCE / math.sqrt(ray_count(job.settings)),
        separates_direct(job, job.settings),
        job.settings.directional,
        last_of,
    )


def _by_hemicubes(job: SolveJob) -> bool:
    """True if irradiance comes to host memory, since OpenGL draws hemicubes in every iteration, or sums."""
    return job.settings.method == "paper" or job.compute is None


def _device_radiosity(job: SolveJob) -> tuple[Radiosity, SolverChoice]:
    """Return the light of all patches on the OpenCL device, gathered through identities."""
    sweep, choice = choose_sweep(job)
    radiosity = DeviceRadiosity(
        job.opencl, sweep, job.parts.surfaces.reflectance, job.front_emission, job.area,
        job.sampled_light, job.gathers_direct, job.columns, job.indirect, _begins_sparse(job, sweep),
        job.direct, job.parts.sides, job.fronts,
    )  # fmt: skip
    return radiosity, choice


def _begins_sparse(job: SolveJob, sweep: DeviceGather) -> bool:
    """Return whether the first sweeps gather from a few samples of each patch.

    They do where many sweeps are to come: not from light that is known.
    """
    if not isinstance(sweep, CachedGather) or not sweep.can_be_sparse:
        return False
    settings = job.settings
    return settings.accelerated and settings.tolerance > 0 and job.indirect is None


def _host_radiosity(job: SolveJob) -> tuple[Radiosity, SolverChoice]:
    """Return the light of all patches in host memory, gathered by OpenGL or as the paper does."""
    gather, choice = _choose_gather(job)
    reflectance = colors_on_host(job.parts.surfaces.reflectance)
    indirect, direct = (
        None if light is None else colors_on_host(light) for light in (job.indirect, job.direct)
    )
    radiosity = HostRadiosity(
        gather, reflectance, job.emission, job.area,
        job.sampled_light, job.gathers_direct, job.columns, indirect, direct, job.parts.sides, job.fronts,
    )  # fmt: skip
    return radiosity, choice


def _choose_gather(job: SolveJob) -> tuple[HostGather, SolverChoice]:
    """Return how hemicubes are drawn and summed."""
    settings, samples = job.settings, 3 * job.settings.hemicube**2
    seen = (job.parts, job.back_emission, job.sky, settings)
    tiles, why = plan_tiles(settings, job.count, IDENTITY_BYTES), "the settings ask for the paper's method"
    if settings.method != "paper":
        if fits_glsl_cache(job.graphics, tiles, job.count):
            reason = "Hemicubes are drawn once and summed by OpenGL: there is no OpenCL."
            return GlslGather(job.graphics, *seen), SolverChoice(
                "cached", "raster", samples, (reason,), "glsl"
            )
        why = "there is no OpenCL, and they are too many to be kept by OpenGL"
    reason = f"Hemicubes are drawn anew in every iteration: {why}."
    paper = PaperGather(job.graphics, job.compute, *seen)
    return paper, SolverChoice("paper", "raster", samples, (reason,), paper.integrator)
