"""Choice of the gather on the OpenCL device: cached, streamed, or by other processes.

"cached" stores the visibility samples of all patches, "stream" computes them again in each iteration.
"""

from __future__ import annotations

import math
from functools import partial

from ..device.cl_device import ComputeDevice
from ..gather.background_light import BackgroundLight
from ..gather.cached_gather import CachedGather, RayStreamGather, StreamGather
from ..gather.interface import DeviceGather
from ..gather.l1_gather import L1Gather, NoL1
from ..gather.peer_stream import PeerStream
from ..gather.remote_gather import RemoteIteration
from ..gather.shared_gather import DeviceParts, DeviceRows, SharedCachedGather
from ..gather.visibility_cache import BackfaceLight, VisibilityCache
from ..visibility.rays.early_hits import EarlyHits
from ..visibility.rays.ray_sampler import RaySampler
from ..visibility.sample_counts import expected_samples
from ..visibility.sampler import SampleLayout, VisibilitySampler
from .memory import is_cached, memory_budget, memory_clause, most_rows, shares_cache
from .solve_job import SolveJob
from .solver_choice import SolverChoice
from .visibility_trial import SAMPLERS, choose_sampler, make_sampler, untried_visibility

#: Report sentence: all visibility samples are reused.
_KEPT = "Visibility was kept from the last bake: geometry, UVs, transparency and settings are unchanged."

#: Report sentence: samples near moved objects were computed again, all others are reused.
_MOVED = "Visibility was kept from the last bake, and recomputed where objects moved."

#: Report sentence: the samples that a cancelled bake had computed are reused.
_RESUMED = "Visibility of a cancelled bake was kept; the rest was computed."

#: Report sentence: the samples of some patches are reused, since memory for all is missing.
_LIMITED = (
    "Visibility of {:.0%} of the texels was kept from the last bake; the rest exceeds the memory of Cached "
    "Visibility and was recomputed."
)


def choose_device_gather(job: SolveJob) -> tuple[DeviceGather, SolverChoice]:
    """Choose the gather for all patches of a job; return it with the reasons for the report."""
    return _remote_gather(job) or _reused_gather(job) or _new_gather(job)


def _remote_gather(job: SolveJob) -> tuple[DeviceGather, SolverChoice] | None:
    """Return the gather by other processes; None if this process gathers."""
    if job.remote is None:
        return None
    choice = SolverChoice(
        "cached", untried_visibility(job.settings), expected_samples(job.settings), (job.remote.describe(),)
    )
    return RemoteIteration(job.opencl, job.remote, job.count), choice


def _reused_gather(job: SolveJob) -> tuple[DeviceGather, SolverChoice] | None:
    """Return a gather from the visibility cache of an earlier bake; None if no valid cache exists."""
    cache, settings = job.kept.samples, job.settings
    if cache is None or not cache.pieces:
        return None
    if cache.others and (settings.warm_start or settings.by_light_groups):
        return None
    if not cache.holds_for(job.patch_scene, job.rays, job.back_emission):
        return None
    sampling, found = cache.sampling, cache.complete
    facts = (sampling.name, sampling.samples, (_reason_of(cache),))
    resumed = 0.0 if cache.moved else cache.fraction
    choice = SolverChoice("cached", *facts, found=found, found_again=cache.moved, resumed=resumed)
    return _cached_gather(job, cache, None if found else make_sampler(job, sampling.name)), choice


def _reason_of(cache: VisibilityCache) -> str:
    """Return the report sentence on a cache that is reused."""
    if cache.complete:
        return _KEPT
    if cache.moved:
        return _MOVED
    return _LIMITED.format(cache.fraction) if cache.limited else _RESUMED


def _new_gather(job: SolveJob) -> tuple[DeviceGather, SolverChoice]:
    """Return a gather that computes new visibility samples."""
    followed, job.kept.samples = job.kept.samples, None
    sampler, reasons, pace = _resumed_sampler(job) or _last_sampler(job, followed) or choose_sampler(job)
    gather, method, reason = _gather_for(job, sampler)
    resumed = job.checkpoint.rows_from_the_first(sampler.name) / job.count if method == "cached" else 0.0
    facts = (method, sampler.name, sampler.samples, (*reasons, reason))
    return gather, SolverChoice(*facts, pace=pace, resumed=resumed)


def _resumed_sampler(job: SolveJob) -> tuple[VisibilitySampler, list[str], float] | None:
    """Return the sampler of the interrupted bake that is resumed, and the reason; None without one.

    The third value, the time of a sample, is NaN.
    """
    begun = sorted(name for name in SAMPLERS if job.checkpoint.rows_from_the_first(name))
    if not begun:
        return None
    return make_sampler(job, begun[0]), [f"The interrupted bake used {begun[0]}."], math.nan


def _last_sampler(
    job: SolveJob, last: VisibilityCache | None
) -> tuple[VisibilitySampler, list[str], float] | None:
    """Return the sampler of the last bake for a warm start, and the reason; None without one.

    The third value, the time of a sample, is NaN.
    """
    if last is None or not job.settings.warm_start:
        return None
    name = last.sampling.name
    return make_sampler(job, name), [f"Visibility uses {name}, as in the last bake."], math.nan


def _gather_for(job: SolveJob, sampler: VisibilitySampler) -> tuple[DeviceGather, str, str]:
    """Return a gather for a visibility sampler, the method's name for the report, and the reason."""
    sizes = memory_clause(job, sampler.row_bytes * job.count)
    if is_cached(job, sampler):
        return caching_gather(job, sampler), "cached", f"Visibility is cached: {sizes}."
    why = f"Visibility is recomputed for every bounce: {sizes}."
    if job.settings.method == "stream":
        why = "Visibility is recomputed for every bounce: the settings request it."
    return stream_gather(job, sampler), "stream", why


def caching_gather(job: SolveJob, sampler: VisibilitySampler) -> DeviceGather:
    """Return a gather that stores visibility in the session cache during the first iteration."""
    job.kept.samples = _empty_cache(job, SampleLayout.of(sampler))
    resumes = job.checkpoint.rows_from_the_first(sampler.name)
    if shares_cache(job) and isinstance(sampler, RaySampler) and not resumes:
        job.kept.background.clear()
        most = most_rows(job, sampler.row_bytes)
        others = [DeviceRows(peer, partial(_new_parts, job.on(peer), most)) for peer in job.rays.peers]
        for rows in others:
            rows.begin()
        early = _early_hits(job) if sampler.row_bytes == sampler.hit_bytes else None
        return _shared_gather(job, job.kept.samples, sampler, others, early)
    return _cached_gather(job, job.kept.samples, sampler)


def _empty_cache(job: SolveJob, sampling: SampleLayout) -> VisibilityCache:
    """Return an empty visibility cache for the patches of a job."""
    seen = (job.patch_scene, job.rays, job.back_emission, job.settings.directional)
    return VisibilityCache(job.opencl, sampling, *seen)


def _new_parts(job: SolveJob, most: int) -> DeviceParts:
    """Return visibility cache, sampler and background light for an additional device.

    The device traces its own share of the patches and gathers from it.

    most:  maximum number of patches in its cache
    """
    sampler = RaySampler(job.opencl, job.rays, job.patch_scene, job.background, job.settings)
    sampling = SampleLayout.of(sampler)
    return DeviceParts(_empty_cache(job, sampling), sampler, static_light(job, sampling), most)


def _kept_rows(job: SolveJob, cache: VisibilityCache) -> DeviceRows:
    """Return the rows of another device that gathers from the samples of the last bake."""
    there = job.on(cache.compute)

    def parts() -> DeviceParts:
        return DeviceParts(cache, None, static_light(there, cache.sampling), cache.count)

    return DeviceRows(cache.compute, parts)


def _shared_gather(
    job: SolveJob,
    cache: VisibilityCache,
    sampler: RaySampler | None,
    others: list[DeviceRows],
    early: EarlyHits | None = None,
) -> DeviceGather:
    """Return a gather by several devices from cached samples; None as sampler if all samples are known."""
    static = static_light(job, cache.sampling)
    most = most_rows(job, cache.sampling.row_bytes)
    own = DeviceRows(job.opencl, lambda: DeviceParts(cache, sampler, static, most))
    return SharedCachedGather(job.opencl, own, others, static, job.checkpoint, early)


def stream_gather(job: SolveJob, sampler: VisibilitySampler) -> DeviceGather:
    """Return a gather that computes visibility in each iteration."""
    sampling = SampleLayout.of(sampler)
    l1, sources = _l1_gather(job, sampling), len(job.emission)
    if isinstance(sampler, RaySampler):
        others = [] if job.settings.directional else _peer_streams(job)
        return RayStreamGather(job.opencl, sampler, job.count, sources, l1, others, _early_hits(job))
    fitting = max(min(memory_budget(job), job.settings.batch_bytes) // sampler.row_bytes, sampler.batch)
    backs = BackfaceLight(job.opencl, job.count, sources, job.settings.directional)
    return StreamGather(
        compute=job.opencl,
        sampler=sampler,
        backs=backs,
        static=static_light(job, sampling),
        count=job.count,
        cached=fitting,
        l1=l1,
    )


def _peer_streams(job: SolveJob) -> list[PeerStream]:
    """Return a stream gather for each other device; the devices share the patches."""
    return [
        PeerStream(peer, partial(_ray_sampler, job, peer), job.count, len(job.emission), _early_hits(job))
        for peer in job.rays.peers
    ]


def _early_hits(job: SolveJob) -> EarlyHits | None:
    """Return the hits of these rays that other devices have traced; None without any."""
    early = job.rays.early
    return early if early and early.serves(job.settings) and not job.settings.directional else None


def _ray_sampler(job: SolveJob, peer: ComputeDevice) -> RaySampler:
    """Return the ray sampler of a job on another device."""
    there = job.on(peer)
    return RaySampler(peer, there.rays, there.patch_scene, there.background, there.settings)


def _cached_gather(job: SolveJob, cache: VisibilityCache, sampler: VisibilitySampler | None) -> DeviceGather:
    """Return a gather from cached samples; `sampler` computes the missing ones, None if there are none."""
    sampling = cache.sampling
    if cache.others:
        return _shared_gather(job, cache, None, [_kept_rows(job, other) for other in cache.others])
    l1 = _l1_gather(job, sampling)
    if sampler is not None:
        job.kept.background.clear()
    static = job.kept.background.get((job.sky,), lambda: static_light(job, sampling))
    return CachedGather(job.opencl, cache, sampler, static, l1, job.checkpoint)


def static_light(job: SolveJob, sampling: SampleLayout) -> BackgroundLight:
    """Return the background light: sky and emissive back faces, constant over all iterations."""
    return BackgroundLight(job.opencl, sampling, job.background, job.rays.receivers, job.settings, job.count)


def _l1_gather(job: SolveJob, sampling: SampleLayout) -> L1Gather | NoL1:
    """Return the gather of L1 for directional maps; an empty one if no map needs it."""
    if not job.settings.directional:
        return NoL1()
    return L1Gather(job.opencl, sampling, job.rays.receivers, job.settings, job.count)
