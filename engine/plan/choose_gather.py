"""Chooses how identities become light on the OpenCL device: kept, found anew in each sweep, or elsewhere."""

from __future__ import annotations

import math

from ..gather.background_light import BackgroundLight
from ..gather.cached_gather import CachedGather, RayStreamGather, StreamGather
from ..gather.device_gather import DeviceGather
from ..gather.l1_gather import L1Gather, NoL1
from ..gather.remote_gather import RemoteIteration
from ..gather.visibility_cache import BackfaceLight, VisibilityCache
from ..visibility.rays.ray_sampler import RaySampler
from ..visibility.sample_counts import expected_samples
from ..visibility.sampler import SampleLayout, VisibilitySampler
from .memory import is_kept, memory_budget, memory_clause
from .solve_job import SolveJob
from .solver_choice import SolverChoice
from .visibility_trial import IDENTITIES, choose_sampler, make_sampler, untried_visibility

#: Why nothing is looked for.
_KEPT = "Visibility was kept from the last bake: no geometry, UVs, transparency or setting of it has changed."

#: Why only some of it is looked for.
_MOVED = "Visibility was kept from the last bake, and found again where something has moved."

#: Why only the rest is looked for.
_RESUMED = "Visibility that a bake before it was cancelled had found was kept; the rest was found now."


def choose_sweep(job: SolveJob) -> tuple[DeviceGather, SolverChoice]:
    """Return what gathers for all patches of a job, and why so."""
    return _remote_sweep(job) or _kept_sweep(job) or _new_sweep(job)


def _remote_sweep(job: SolveJob) -> tuple[DeviceGather, SolverChoice] | None:
    """Return how devices of other processes gather, None if this process does."""
    if job.remote is None:
        return None
    choice = SolverChoice(
        "cached",
        untried_visibility(job.settings),
        expected_samples(job.settings),
        (job.remote.describe(),),
    )
    return RemoteIteration(job.opencl, job.remote, job.count), choice


def _kept_sweep(job: SolveJob) -> tuple[DeviceGather, SolverChoice] | None:
    """Return how what an earlier bake has kept becomes light, None if there is nothing that holds."""
    kept = job.kept.samples
    if kept is None or not kept.pieces or not kept.holds_for(job.parts, job.rays, job.back_emission):
        return None
    sampling, found = kept.sampling, kept.complete
    why = _KEPT if found else _MOVED if kept.moved else _RESUMED
    facts = (sampling.name, sampling.samples, (why,))
    choice = SolverChoice("cached", *facts, found=found, found_again=kept.moved)
    return _cached_sweep(job, kept, None if found else make_sampler(job, sampling.name)), choice


def _new_sweep(job: SolveJob) -> tuple[DeviceGather, SolverChoice]:
    """Return how identities become light."""
    followed, job.kept.samples = job.kept.samples, None
    identity, reasons, pace = _resumed_identity(job) or _last_identity(job, followed) or choose_sampler(job)
    sweep, method, reason = _sweep_of(job, identity)
    resumed = job.checkpoint.rows_from_the_first(identity.name) / job.count if method == "cached" else 0.0
    facts = (method, identity.name, identity.samples, (*reasons, reason))
    return sweep, SolverChoice(*facts, pace=pace, resumed=resumed)


def _resumed_identity(job: SolveJob) -> tuple[VisibilitySampler, list[str], float] | None:
    """Return the way in which an interrupted bake has begun to find what patches see, None if none has."""
    begun = sorted(name for name in IDENTITIES if job.checkpoint.rows_from_the_first(name))
    if not begun:
        return None
    return make_sampler(job, begun[0]), [f"A bake that was interrupted has begun with {begun[0]}."], math.nan


def _last_identity(
    job: SolveJob, last: VisibilityCache | None
) -> tuple[VisibilitySampler, list[str], float] | None:
    """Return the way in which a bake that follows its scene has found what patches see; None if none has."""
    if last is None or not job.settings.warm_start:
        return None
    name = last.sampling.name
    return make_sampler(job, name), [f"It is found by {name}, as in the last bake."], math.nan


def _sweep_of(job: SolveJob, identity: VisibilitySampler) -> tuple[DeviceGather, str, str]:
    """Return how identities become light, the method's name, and why."""
    sizes = memory_clause(job, identity.row_bytes * job.count)
    if is_kept(job, identity):
        return caching_gather(job, identity), "cached", f"It is kept: {sizes}."
    why = f"It is found anew in every iteration: {sizes}."
    if job.settings.method == "stream":
        why = "It is found anew in every iteration: the settings ask for it."
    return stream_sweep(job, identity), "stream", why


def caching_gather(job: SolveJob, identity: VisibilitySampler) -> DeviceGather:
    """Return a sweep that finds what patches see at first, and leaves it to the next bake."""
    sampling = SampleLayout.of(identity)
    seen = (job.parts, job.rays, job.back_emission, job.settings.directional)
    job.kept.samples = VisibilityCache(job.opencl, sampling, *seen)
    return _cached_sweep(job, job.kept.samples, identity)


def stream_sweep(job: SolveJob, identity: VisibilitySampler) -> DeviceGather:
    """Return how identities become light without being kept."""
    sampling = SampleLayout.of(identity)
    l1, sources = _l1_gather(job, sampling), len(job.emission)
    if isinstance(identity, RaySampler):
        return RayStreamGather(job.opencl, identity, job.count, sources, l1)
    fitting = max(min(memory_budget(job), job.settings.batch_bytes) // identity.row_bytes, identity.batch)
    backs = BackfaceLight(job.opencl, job.count, sources, job.settings.directional)
    return StreamGather(job.opencl, identity, backs, static_light(job, sampling), job.count, fitting, l1)


def _cached_sweep(job: SolveJob, kept: VisibilityCache, identity: VisibilitySampler | None) -> DeviceGather:
    """Return how what is kept, or is to be found by an identity first, becomes light."""
    sampling = kept.sampling
    l1 = _l1_gather(job, sampling)
    static = job.kept.static_light(job.sky, identity is None, lambda: static_light(job, sampling))
    return CachedGather(job.opencl, kept, identity, static, l1, job.checkpoint)


def static_light(job: SolveJob, sampling: SampleLayout) -> BackgroundLight:
    """Return what sums up the light that no bounce changes."""
    return BackgroundLight(
        job.opencl, sampling, job.surroundings, job.rays.receivers, job.settings, job.count
    )


def _l1_gather(job: SolveJob, sampling: SampleLayout) -> L1Gather | NoL1:
    """Return what gathers L1 for directional maps, if the settings ask for any."""
    if not job.settings.directional:
        return NoL1()
    return L1Gather(job.opencl, sampling, job.rays.receivers, job.settings, job.count)
