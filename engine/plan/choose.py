"""Chooses how patches gather and who solves for their light: by the settings, by memory, by a trial."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..gather.cached import CachedSweep, RayStreamSweep, StreamSweep
from ..gather.final_gather import FinalGather, LightGather
from ..gather.glsl_cached import fits_glsl_cache
from ..gather.hemicube_gather import Gather, GlslGather, PaperGather
from ..gather.kept_samples import Backs, KeptSamples
from ..gather.l1_gather import L1Gather, NoL1
from ..gather.remote import RemoteFinal, RemoteSweep
from ..gather.static_light import StaticLight
from ..gather.sweep import Sweep
from ..patches.subdivision import Subdivision
from ..scene.digests import digest_of
from ..settings import Settings
from ..solve.darkness import Darkness
from ..solve.device_radiosity import DeviceRadiosity
from ..solve.grouped_solution import GroupedSolution
from ..solve.host_radiosity import HostRadiosity
from ..solve.interpolated_gather import InterpolatedGather
from ..solve.interpolation import Interpolation
from ..solve.last_gather import LastGather
from ..solve.patch_groups import PatchGroups, leaders, numbered
from ..solve.resumed_solver import ResumedSolver
from ..solve.solver import Radiosity, Solution, Solver
from ..visibility.identity import Identity, Sampling
from ..visibility.raster.tiles import IDENTITY_BYTES, plan_tiles
from ..visibility.rays.identity import RayIdentity
from ..visibility.rays.ray_scene import RayScene
from ..visibility.samples import expected_samples, ray_count
from .choice import Choice
from .memory import MORE_RAYS, group_width, is_adaptive, is_kept, memory_budget, memory_clause
from .solve_job import SolveJob
from .trial import IDENTITIES, choose_identity, make_identity, untried_visibility

#: Why nothing is looked for.
_KEPT = "Visibility was kept from the last bake: no geometry, UVs, transparency or setting of it has changed."

#: Why only some of it is looked for.
_MOVED = "Visibility was kept from the last bake, and found again where something has moved."

#: Why only the rest is looked for.
_RESUMED = "Visibility that a bake before it was cancelled had found was kept; the rest was found now."

#: What a plane through the light of groups may leave over, as a fraction of all light, times the root of the
#: rays of a patch: about the error of these.
_TOLERANCE = 0.6

#: Width of the smaller squares, texels, of which one patch gathers first where groups are too coarse.
_SMALLER = 2

#: Patches that gather for themselves, as a fraction, before it is known.
_GATHERING = 0.25


def choose_solver(job: SolveJob) -> tuple[Solution, Choice, SolveJob]:
    """Return what solves a bake's light, the way that was chosen for patches to gather, and what is solved.

    That is the job itself, or that of groups of its patches.
    """
    if job.dark:
        job.kept.light = None
        why = "No light reaches any patch: nothing is looked for."
        return Darkness(job.count), Choice("none", "none", 0, (why,)), job
    width, reasons = group_width(job)
    if width == 1:
        return *_solver(job), job
    solution, choice, squares = _grouped_solution(job, width)
    return solution, replace(choice, reasons=(*reasons, *choice.reasons)), squares


def solver_like(job: SolveJob, choice: Choice) -> Solver:
    """Return what solves for a part of the light, with samples as were chosen for all of it."""
    settings = replace(job.settings, method=choice.method, visibility=choice.visibility)
    return _solver(replace(job, settings=settings, indirect=None))[0]


def _solver(job: SolveJob) -> tuple[Solver, Choice]:
    """Return what solves for every patch on its own."""
    radiosity, choice = _host_radiosity(job) if _by_hemicubes(job) else _device_radiosity(job)
    gathered_by = (choice.method, choice.visibility, choice.samples, choice.integrator)
    solver = ResumedSolver(
        radiosity, job.sampled_light, job.settings, job.gathers_direct, job.indirect is not None,
        job.checkpoint, lambda: digest_of((*job.light_key, *gathered_by)),
    )  # fmt: skip
    return solver, replace(choice, patches=job.count)


def _grouped_solution(job: SolveJob, width: int) -> tuple[GroupedSolution, Choice, SolveJob]:
    """Return what solves for squares of patches, then gathers for each patch."""
    leader = leaders(job.rays, job.parts, job.first_radiance, job.kept.inside(job.rays), width)
    if job.remote is not None:
        job.remote.of_groups(leader, width)
    groups = PatchGroups(job.rays, job.parts, job.area, leader, width)
    squares = replace(
        job,
        settings=_settings_of_groups(job),
        parts=groups.parts,
        rays=groups.rays,
        emission=groups.mean(job.emission),
        sampled_light=groups.mean(job.sampled_light),
        area=groups.area,
        indirect=None if job.indirect is None else groups.mean(job.indirect),
    )
    solver, choice = _solver(squares)
    if is_adaptive(job):
        choice = replace(choice, final_samples=int(_GATHERING * job.count * ray_count(job.settings)))
        between = _interpolated(job, squares, solver, groups, choice)
        return GroupedSolution(solver, groups, between), choice, squares
    receivers = Receivers(job.parts, job.rays, job.sampled_light)
    last, samples = last_gather(squares, choice, receivers, job.settings)
    return GroupedSolution(solver, groups, last), replace(choice, final_samples=samples), squares


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


def _interpolated(
    job: SolveJob, squares: SolveJob, solver: Solver, groups: PatchGroups, choice: Choice
) -> InterpolatedGather:
    """Return what gathers for the patches that differ from the groups around them."""

    def last_of(chosen: np.ndarray) -> LastGather:
        parts = job.parts.part(chosen)
        receivers = Receivers(parts, job.rays.of(parts), job.sampled_light[chosen])
        return last_gather(squares, choice, receivers, job.settings)[0]

    inside = job.kept.inside(job.rays)
    smaller = numbered(leaders(job.rays, job.parts, job.first_radiance, inside, _SMALLER))
    widths = ((groups.group, groups.leader, groups.width), (*smaller, _SMALLER))
    return InterpolatedGather(
        solver,
        [Interpolation(job.rays, job.parts, *squares_of_width) for squares_of_width in widths],
        job.sampled_light,
        squares.sampled_light,
        _TOLERANCE / math.sqrt(ray_count(job.settings)),
        _separates_direct(job, job.settings),
        job.settings.directional,
        last_of,
    )


@dataclass(frozen=True)
class Receivers:
    """Points that gather once light has settled: patches, or points of texels.

    sampled_light  (n, 3) float32, E/pi of the light that shadow rays sample
    """

    parts: Subdivision
    rays: RayScene
    sampled_light: np.ndarray


def last_gather(
    solved: SolveJob, choice: Choice, receivers: Receivers, settings: Settings
) -> tuple[LastGather, int]:
    """Return what gathers from the patches of a job, and how many samples it takes of all receivers together.

    The receivers look for themselves, but see the patches of the job.
    """
    final: LightGather
    if solved.remote is not None:
        lit = receivers.sampled_light
        final, samples = RemoteFinal(solved.opencl, solved.remote, lit, solved.count), choice.samples
    else:
        final, samples = final_gather(solved, choice.visibility, receivers, settings)
    reflectance = solved.parts.surfaces.reflectance
    last = LastGather(
        final,
        receivers.sampled_light,
        solved.emission,
        reflectance,
        settings.bounces,
        _separates_direct(solved, settings),
    )
    return last, last.gathers * len(receivers.sampled_light) * samples


def final_gather(
    solved: SolveJob, visibility: str, receivers: Receivers, settings: Settings
) -> tuple[FinalGather, int]:
    """Return what gathers on this device from the patches of a job, and the samples of each receiver."""
    lookers = looking(solved, receivers, settings)
    identity = make_identity(lookers, visibility)
    return FinalGather(solved.opencl, _stream(lookers, identity), receivers.sampled_light), identity.samples


def looking(solved: SolveJob, receivers: Receivers, settings: Settings) -> SolveJob:
    """Return what receivers look for that see the patches of a job."""
    parts = replace(receivers.parts, texel_to_patch=solved.parts.texel_to_patch)
    return replace(
        solved,
        parts=parts,
        rays=receivers.rays,
        sampled_light=receivers.sampled_light,
        settings=settings,
    )


def _separates_direct(solved: SolveJob, settings: Settings) -> bool:
    """Return whether what is gathered before any bounce is an output, or a part of one."""
    return solved.gathers_direct and not {"direct", "indirect"}.isdisjoint(settings.outputs)


def _by_hemicubes(job: SolveJob) -> bool:
    """True if irradiance comes to host memory, since OpenGL draws hemicubes in every iteration, or sums."""
    return job.settings.method == "paper" or job.compute is None


def _device_radiosity(job: SolveJob) -> tuple[Radiosity, Choice]:
    """Return the light of all patches on the OpenCL device, gathered through identities."""
    sweep, choice = _remote_sweep(job) or _kept_sweep(job) or _new_sweep(job)
    radiosity = DeviceRadiosity(
        job.opencl, sweep, job.parts.surfaces.reflectance, job.surroundings.emission, job.area,
        job.sampled_light, job.gathers_direct, job.columns, job.indirect, _begins_sparse(job, sweep),
    )  # fmt: skip
    return radiosity, choice


def _begins_sparse(job: SolveJob, sweep: Sweep) -> bool:
    """Return whether the first sweeps gather from a few samples of each patch.

    They do where many sweeps are to come: not from light that is known.
    """
    if not isinstance(sweep, CachedSweep) or not sweep.can_be_sparse:
        return False
    settings = job.settings
    return settings.accelerated and settings.tolerance > 0 and job.indirect is None


def _remote_sweep(job: SolveJob) -> tuple[Sweep, Choice] | None:
    """Return how devices of other processes gather, None if this process does."""
    if job.remote is None:
        return None
    choice = Choice(
        "cached",
        untried_visibility(job.settings),
        expected_samples(job.settings),
        (job.remote.describe(),),
    )
    return RemoteSweep(job.opencl, job.remote, job.count), choice


def _kept_sweep(job: SolveJob) -> tuple[Sweep, Choice] | None:
    """Return how what an earlier bake has kept becomes light, None if there is nothing that holds."""
    kept = job.kept.samples
    if kept is None or not kept.pieces or not kept.holds_for(job.parts, job.rays, job.emission):
        return None
    sampling, found = kept.sampling, kept.complete
    why = _KEPT if found else _MOVED if kept.moved else _RESUMED
    facts = (sampling.name, sampling.samples, (why,))
    choice = Choice("cached", *facts, found=found, found_again=kept.moved)
    return _cached(job, kept, None if found else make_identity(job, sampling.name)), choice


def _new_sweep(job: SolveJob) -> tuple[Sweep, Choice]:
    """Return how identities become light."""
    followed, job.kept.samples = job.kept.samples, None
    identity, reasons, pace = _resumed_identity(job) or _last_identity(job, followed) or choose_identity(job)
    sweep, method, reason = _choose_sweep(job, identity)
    resumed = job.checkpoint.rows_from_the_first(identity.name) / job.count if method == "cached" else 0.0
    facts = (method, identity.name, identity.samples, (*reasons, reason))
    return sweep, Choice(*facts, pace=pace, resumed=resumed)


def _resumed_identity(job: SolveJob) -> tuple[Identity, list[str], float] | None:
    """Return the way in which an interrupted bake has begun to find what patches see, None if none has."""
    begun = sorted(name for name in IDENTITIES if job.checkpoint.rows_from_the_first(name))
    if not begun:
        return None
    return make_identity(job, begun[0]), [f"A bake that was interrupted has begun with {begun[0]}."], math.nan


def _last_identity(job: SolveJob, last: KeptSamples | None) -> tuple[Identity, list[str], float] | None:
    """Return the way in which a bake that follows its scene has found what patches see; None if none has."""
    if last is None or not job.settings.warm_start:
        return None
    name = last.sampling.name
    return make_identity(job, name), [f"It is found by {name}, as in the last bake."], math.nan


def _host_radiosity(job: SolveJob) -> tuple[Radiosity, Choice]:
    """Return the light of all patches in host memory, gathered by OpenGL or as the paper does."""
    gather, choice = _choose_gather(job)
    reflectance = job.parts.surfaces.reflectance
    radiosity = HostRadiosity(
        gather, reflectance, job.emission, job.area,
        job.sampled_light, job.gathers_direct, job.columns, job.indirect,
    )  # fmt: skip
    return radiosity, choice


def _choose_gather(job: SolveJob) -> tuple[Gather, Choice]:
    """Return how hemicubes are drawn and summed."""
    settings, samples = job.settings, 3 * job.settings.hemicube**2
    seen = (job.parts, job.emission, job.sky, settings)
    tiles, why = plan_tiles(settings, job.count, IDENTITY_BYTES), "the settings ask for the paper's method"
    if settings.method != "paper":
        if fits_glsl_cache(job.graphics, tiles, job.count):
            reason = "Hemicubes are drawn once and summed by OpenGL: there is no OpenCL."
            return GlslGather(job.graphics, *seen), Choice("cached", "raster", samples, (reason,), "glsl")
        why = "there is no OpenCL, and they are too many to be kept by OpenGL"
    reason = f"Hemicubes are drawn anew in every iteration: {why}."
    paper = PaperGather(job.graphics, job.compute, *seen)
    return paper, Choice("paper", "raster", samples, (reason,), paper.integrator)


def _choose_sweep(job: SolveJob, identity: Identity) -> tuple[Sweep, str, str]:
    """Return how identities become light, the method's name, and why."""
    sizes = memory_clause(job, identity.row_bytes * job.count)
    if is_kept(job, identity):
        return keeping_sweep(job, identity), "cached", f"It is kept: {sizes}."
    why = f"It is found anew in every iteration: {sizes}."
    if job.settings.method == "stream":
        why = "It is found anew in every iteration: the settings ask for it."
    return _stream(job, identity), "stream", why


def keeping_sweep(job: SolveJob, identity: Identity) -> Sweep:
    """Return a sweep that finds what patches see at first, and leaves it to the next bake."""
    sampling = Sampling.of(identity)
    seen = (job.parts, job.rays, job.emission, job.settings.directional)
    job.kept.samples = KeptSamples(job.opencl, sampling, *seen)
    return _cached(job, job.kept.samples, identity)


def _stream(job: SolveJob, identity: Identity) -> Sweep:
    """Return how identities become light without being kept."""
    sampling = Sampling.of(identity)
    l1, sources = _l1_gather(job, sampling), len(job.emission)
    if isinstance(identity, RayIdentity):
        return RayStreamSweep(job.opencl, identity, job.count, sources, l1)
    fitting = max(min(memory_budget(job), job.settings.batch_bytes) // identity.row_bytes, identity.batch)
    backs = Backs(job.opencl, job.count, sources, job.settings.directional)
    return StreamSweep(job.opencl, identity, backs, static_light(job, sampling), job.count, fitting, l1)


def _cached(job: SolveJob, kept: KeptSamples, identity: Identity | None) -> Sweep:
    """Return how what is kept, or is to be found by an identity first, becomes light."""
    sampling = kept.sampling
    l1 = _l1_gather(job, sampling)
    return CachedSweep(job.opencl, kept, identity, static_light(job, sampling), l1, job.checkpoint)


def static_light(job: SolveJob, sampling: Sampling) -> StaticLight:
    """Return what sums up the light that no bounce changes."""
    return StaticLight(job.opencl, sampling, job.surroundings, job.rays.receivers, job.settings, job.count)


def _l1_gather(job: SolveJob, sampling: Sampling) -> L1Gather | NoL1:
    """Return what gathers L1 for directional maps, if the settings ask for any."""
    if not job.settings.directional:
        return NoL1()
    return L1Gather(job.opencl, sampling, job.rays.receivers, job.settings, job.count)
