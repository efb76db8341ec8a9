"""Choice of the solver: for each patch or for patch groups, on the device or the host."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..device.device_array import colors_on_host
from ..direct.contact import Contacts
from ..gather.cached_gather import CachedGather
from ..gather.glsl_cached import fits_glsl_cache
from ..gather.hemicube_gather import GlslGather, PaperGather
from ..gather.interface import DeviceGather, Gather
from ..gather.shader_gather import ShaderGather
from ..scene.digests import digest_of
from ..settings import Settings
from ..solve.device_radiosity import DeviceRadiosity
from ..solve.final_gather import FinalGather
from ..solve.grouped_solution import GroupedSolution
from ..solve.host_radiosity import HostRadiosity
from ..solve.interpolated_gather import InterpolatedGather
from ..solve.interpolation import Interpolation
from ..solve.patch_groups import PatchGroups, SinglePatches, group_representatives, numbered
from ..solve.radiosity_state import Radiosity
from ..solve.resumed_solver import ResumedSolver
from ..solve.solution import BlackSolution, Solution
from ..solve.solver import ChooseSubstitutes, FirstGather, Solver
from ..validity.invalid import is_invalid, patches_near_backs
from ..validity.substitutes import substitute_patches
from ..visibility.raster.tiles import IDENTITY_BYTES, plan_tiles
from ..visibility.rays.ray_scene import openness
from ..visibility.rays.shaders.shader_scene import ShaderScene
from ..visibility.sample_counts import ray_count
from .choose_gather import choose_device_gather
from .memory import MORE_RAYS, group_width, is_adaptive, is_smoothed
from .receivers import Receivers, make_final_gather, separates_direct
from .sharing import rays_of_groups
from .solve_job import SolveJob
from .solver_choice import SolverChoice

#: Tolerance of interpolation between patch groups. An irradiance plane is fitted to neighbouring groups; its
#: residual, relative to the irradiance, may be at most this value divided by the square root of the samples
#: per patch. That is three times the sampling error, because most of the residual is noise that the plane
#: averages out. Where irradiance is curved, the centre of the plane is closer than the residual suggests.
_TOLERANCE = 2.0

#: Width of the smaller groups, texels. Where 4 x 4 groups are too coarse, one patch of each gathers first.
_SMALLER = 2

#: Distance in texels below which geometry counts as near. Patches next to geometry that the groups do not
#: sample gather themselves.
_NEAR = 2.0

#: Expected fraction of patches that gather themselves, for the estimate of the work. Fraction = first value +
#: second value x (groups per patch above 1 / width^2). Fitted to a room, a living room and a level of 1024 x
#: 1024 texels, with 4, 22 and 22 % for 0.065, 0.153 and 0.128 groups of 16 texels per patch.
_GATHERING, _GATHERING_OF_GROUP = 0.04, 2.3


def choose_solver(job: SolveJob) -> tuple[Solution, SolverChoice, SolveJob]:
    """Return the solution, the choice of the gather, and the job that is solved.

    The returned job is `job` itself, or the job of its patch groups.
    """
    if job.dark:
        job.kept.light = None
        why = "No light reaches any texel: visibility is not computed."
        return BlackSolution(job.count), SolverChoice("none", "none", 0, (why,)), job
    width, reasons = group_width(job)
    if width == 1:
        return *(_smoothed_solution(job) if is_smoothed(job) else _solver(job)), job
    solution, choice, groups_job = _grouped_solution(job, width)
    return solution, replace(choice, reasons=(*reasons, *choice.reasons)), groups_job


def solver_like(job: SolveJob, choice: SolverChoice, substitute: np.ndarray | None) -> Solver:
    """Return a solver for one part of the light, such as a light group.

    It uses the samples of `choice` and the substitutes of the solution of all light. substitute: (n,) uint32,
    substitute of each patch; None if all are valid.
    """
    settings = replace(job.settings, method=choice.method, visibility=choice.visibility)
    part = replace(job, settings=settings, indirect=None, direct=None, validity=None)
    return _solver(part, lambda _: substitute)[0]


def _solver(
    job: SolveJob, choose_substitutes: ChooseSubstitutes | None = None
) -> tuple[Solver, SolverChoice]:
    """Return a solver with one unknown for each patch; see `Solver`."""
    if choose_substitutes is None and job.contacts is not None:
        choose_substitutes = partial(_substitutes, job, job.contacts)
    radiosity, choice = _host_radiosity(job) if _by_hemicubes(job) else _device_radiosity(job)
    gathered_by = (choice.method, choice.visibility, choice.samples, choice.integrator)
    solver = ResumedSolver(
        radiosity,
        job.start,
        job.settings,
        choose_substitutes,
        job.validity,
        job.checkpoint,
        key=lambda: digest_of((*job.light_key, *gathered_by)),
    )
    return solver, replace(choice, patches=job.count)


def _substitutes(job: SolveJob, contacts: Contacts, gathered: FirstGather) -> np.ndarray | None:
    """Return the substitute of each patch, (n,) uint32, from the first iteration; None if all are valid."""
    invalid = is_invalid(gathered.validity, contacts)
    find_pairs = partial(job.kept.find_substitutes, compute=job.compute)
    return substitute_patches(job.patch_scene, invalid, gathered.light_of, find_pairs)


def _grouped_solution(job: SolveJob, width: int) -> tuple[GroupedSolution, SolverChoice, SolveJob]:
    """Return a solution that solves for patch groups, then gathers for each patch."""
    inside = job.kept.inside(job.rays)
    representative = group_representatives(
        job.rays, job.patch_scene, job.first_radiance, inside, width, job.mapped
    )
    groups = PatchGroups(job.rays, job.patch_scene, job.area, representative, width)
    emission = groups.mean(job.emission)
    backs = None if job.backs is None else groups.mean(job.backs)
    if job.remote is not None:
        # Other processes start to compute the visibility of groups while this process prepares the solver.
        job.remote.of_groups(
            groups.representative, groups.texel_to_group, emission if backs is None else backs
        )
    groups_job = replace(
        job,
        settings=_settings_of_groups(job),
        patch_scene=groups.patch_scene,
        rays=rays_of_groups(job.rays, groups.patch_scene, job.settings),
        emission=emission,
        backs=backs,
        sampled_light=groups.mean(job.sampled_light),
        areas=groups.area,
        indirect=None if job.indirect is None else groups.mean(colors_on_host(job.indirect)),
        direct=None,
        validity=None,
        contacts=job.contacts and job.contacts.subset(groups.representative),
    )
    solver, choice = _solver(groups_job)
    if is_adaptive(job):
        gathering = gathering_fraction(choice.patches / job.count, width)
        choice = replace(choice, final_samples=int(gathering * job.count * ray_count(job.settings)))
        between = _interpolated(job, groups_job, solver, choice, _groupings(job, groups))
        return GroupedSolution(solver, groups, between), choice, groups_job
    receivers = Receivers(job.patch_scene, job.rays, job.sampled_light)
    final, samples = make_final_gather(groups_job, choice, receivers, job.settings)
    return GroupedSolution(solver, groups, final), replace(choice, final_samples=samples), groups_job


def gathering_fraction(groups: float, width: int) -> float:
    """Return the expected fraction of patches that gather themselves, since they do not fit a plane.

    Edges and contacts split groups, and light is rarely smooth there.

    groups:  number of groups per patch
    width:   width of a full group, texels
    """
    return min(1.0, _GATHERING + _GATHERING_OF_GROUP * max(0.0, groups - 1 / width**2))


def _smoothed_solution(job: SolveJob) -> tuple[GroupedSolution, SolverChoice]:
    """Return a solution for each patch that a plane fit over its neighbours then denoises."""
    solver, choice = _solver(job)
    between = _interpolated(job, job, solver, choice, [])
    reasons = (*choice.reasons, "Light that lies in a plane around a patch is taken from the plane.")
    solution = GroupedSolution(solver, SinglePatches(job.count), between)
    return solution, replace(choice, reasons=reasons)


def _settings_of_groups(job: SolveJob) -> Settings:
    """Return the settings for the iteration over groups, which computes irradiance without other outputs.

    Adaptive bakes interpolate directional maps from the groups too, and use more samples for each group.
    """
    settings = light_alone(job.settings)
    if not is_adaptive(job):
        return settings
    outputs = settings.outputs + job.settings.directional_outputs
    return replace(settings, outputs=outputs, samples=MORE_RAYS * ray_count(settings))


def light_alone(settings: Settings) -> Settings:
    """Return the settings with light outputs only."""
    return replace(settings, outputs=settings.light_outputs)


#: A patch grouping: group of each patch, (n,) uint32; representative patch of each group; width, texels.
_Grouping = tuple[np.ndarray, np.ndarray, int]


def _groupings(job: SolveJob, groups: PatchGroups) -> list[_Grouping]:
    """Return the groupings for the interpolation: the solved groups, then the smaller ones."""
    inside = job.kept.inside(job.rays)
    smaller_representative = group_representatives(
        job.rays, job.patch_scene, job.first_radiance, inside, _SMALLER, job.mapped
    )
    smaller = numbered(smaller_representative)
    return [(groups.group, groups.representative, groups.width), (*smaller, _SMALLER)]


def _interpolated(
    job: SolveJob, solved: SolveJob, solver: Solver, choice: SolverChoice, groupings: Sequence[_Grouping]
) -> InterpolatedGather:
    """Return the final gather that interpolates smooth patches and traces the others.

    job:     all patches
    solved:  job of the patches, or of the first grouping of `groupings`, that `solver` solves
    solver:  solution of `solved`
    choice:  choice of the gather
    groupings:  groupings, coarse to fine
    """

    def last_of(chosen: np.ndarray) -> FinalGather:
        patch_scene = job.patch_scene.subset(chosen)
        receivers = Receivers(patch_scene, job.rays.of(patch_scene), job.sampled_light[chosen])
        return make_final_gather(solved, choice, receivers, job.settings)[0]

    # Groups have too few samples to detect geometry near the patches between them.
    opening = openness(job.rays, _NEAR) if groupings else None
    backs = None if job.patch_scene.triangles.backs is None else patches_near_backs(job.rays, job.count)
    patches = np.arange(job.count)
    return InterpolatedGather(
        solver=solver,
        groupings=[
            Interpolation(job.rays, job.patch_scene, *grouping, opening, backs) for grouping in groupings
        ],
        neighbours=Interpolation(
            rays=job.rays,
            patch_scene=job.patch_scene,
            group=patches,
            representative=patches,
            width=1,
            opening=opening,
            beside_backs=backs,
        ),
        sampled_light=job.sampled_light,
        of_groups=solved.sampled_light,
        tolerance=_TOLERANCE / math.sqrt(ray_count(job.settings)),
        separate_direct=separates_direct(job, job.settings),
        directional=job.settings.directional,
        last_of=last_of,
    )


def _by_hemicubes(job: SolveJob) -> bool:
    """Return True if irradiance is in host memory: OpenGL draws hemicubes in each iteration, or sums them."""
    return job.settings.method == "paper" or job.compute is None


def _device_radiosity(job: SolveJob) -> tuple[Radiosity, SolverChoice]:
    """Return the radiosity state on the OpenCL device, which gathers through visibility samples."""
    sweep, choice = choose_device_gather(job)
    radiosity = DeviceRadiosity(
        job.opencl,
        sweep,
        job.surfaces,
        job.front_emission,
        job.start,
        job.columns,
        _begins_sparse(job, sweep),
    )
    return radiosity, choice


def _begins_sparse(job: SolveJob, sweep: DeviceGather) -> bool:
    """Return True if the first iterations may use a few samples of each patch.

    This pays if many iterations follow, so not if the bake starts from known light.
    """
    if not isinstance(sweep, CachedGather) or not sweep.can_be_sparse:
        return False
    settings = job.settings
    return settings.accelerated and settings.tolerance > 0 and job.indirect is None


def _host_radiosity(job: SolveJob) -> tuple[Radiosity, SolverChoice]:
    """Return the radiosity state in host memory, with hemicubes by OpenGL or by the paper's method."""
    gather, choice = _choose_gather(job)
    return HostRadiosity(gather, job.surfaces, job.emission, job.start, job.columns), choice


def _choose_gather(job: SolveJob) -> tuple[Gather, SolverChoice]:
    """Return the gather that draws hemicubes and sums them, and the choice with its reasons."""
    settings, samples = job.settings, 3 * job.settings.hemicube**2
    seen = (job.patch_scene, job.back_emission, job.sky, settings)
    tiles, why = plan_tiles(settings, job.count, IDENTITY_BYTES), "the settings request the paper's method"
    if settings.method != "paper":
        if job.rays.shaders is not None and (settings.visibility != "raster" or settings.directional):
            return _shader_gather(job, job.rays.shaders)
        if fits_glsl_cache(job.graphics, tiles, job.count):
            reason = "Hemicubes are drawn once and summed by OpenGL: there is no OpenCL device."
            return GlslGather(job.graphics, *seen), SolverChoice(
                "cached", "raster", samples, (reason,), "glsl"
            )
        why = "there is no OpenCL device, and they exceed the memory of OpenGL"
    reason = f"Hemicubes are drawn for every bounce: {why}."
    paper = PaperGather(job.graphics, job.compute, *seen)
    return paper, SolverChoice("paper", "raster", samples, (reason,), paper.integrator)


def _shader_gather(job: SolveJob, shaders: ShaderScene) -> tuple[Gather, SolverChoice]:
    """Return the gather that traces samples with compute shaders, and the choice with its reasons."""
    gather = ShaderGather(shaders, job.patch_scene, job.back_emission, job.sky, job.settings)
    reason = "OpenGL casts rays and sums light: there is no OpenCL device."
    method = "cached" if gather.keeps_all else "stream"
    return gather, SolverChoice(method, "rays", gather.samples, (reason,), "glsl")
