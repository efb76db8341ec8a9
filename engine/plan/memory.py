"""Device memory of visibility samples: decides on caching and on patch groups."""

from __future__ import annotations

from ..settings import Settings
from ..visibility.sample_counts import expected_samples, sample_bytes
from ..visibility.sampler import VisibilitySampler
from .solve_job import SolveJob

#: Width of patch groups, texels.
_GROUP_WIDTH = 4

#: Samples of a patch group per sample of a patch, if light between groups is
#: interpolated.
MORE_RAYS = 3

#: Maximum number of patches with one unknown each where other processes gather, since each process receives
#: the light of all patches in each iteration. Independent of memory, so that results do not depend on the
#: devices.
_MOST_SHARED = 1 << 22

#: Minimum number of patches for adaptive interpolation between groups. Groups of coarse texels rarely fit a
#: plane, and sorting the patches costs more than it saves.
_FEWEST = 1 << 14


def memory_budget(job: SolveJob) -> int:
    """Return the memory of all devices for visibility samples, bytes; half of each device by default."""
    return device_budget(job) * (1 + len(job.rays.peers) if shares_cache(job) else 1)


def device_budget(job: SolveJob) -> int:
    """Return the memory of one device for visibility samples, bytes."""
    memory = job.opencl.device.global_mem_size
    return min(job.settings.memory_budget or memory // 2, memory)


def most_rows(job: SolveJob, row_bytes: int) -> int:
    """Return the maximum number of patches whose samples one of the sharing devices keeps.

    The budget rounds down; an equal share rounds up, so that the devices together hold all patches.

    row_bytes:  size of the samples of a patch, bytes
    """
    return max(device_budget(job) // row_bytes, -(-job.count // (1 + len(job.rays.peers))))


def shares_cache(job: SolveJob) -> bool:
    """Return True if several devices keep the visibility samples of the patches, each of a part of them.

    Directional maps and light groups read samples on one device.
    """
    settings = job.settings
    return (
        bool(job.rays.peers)
        and settings.visibility != "raster"
        and not (settings.directional or settings.by_light_groups or settings.warm_start)
    )


def is_cached(job: SolveJob, sampler: VisibilitySampler) -> bool:
    """Return True if the samples of all patches are cached."""
    budget = memory_budget(job) if sampler.name == "rays" else device_budget(job)
    return job.settings.method != "stream" and sampler.row_bytes * job.count <= budget


def visibility_passes(job: SolveJob, sampler: VisibilitySampler) -> int:
    """Return the number of iterations that compute visibility: 1 if it is cached, else all."""
    return 1 if is_cached(job, sampler) else max(2, job.settings.max_bounces)


def is_adaptive(job: SolveJob) -> bool:
    """Return True if patches that fit the plane of the groups around them are interpolated, not traced.

    Used on CPUs only: a GPU traces the saved rays faster than the host sorts the patches.
    """
    return _interpolates(job) and job.count >= _FEWEST


def is_smoothed(job: SolveJob) -> bool:
    """Return True if a plane fit denoises the gathered light of patches.

    Not with Denoise, which removes more of noise that is independent between patches.
    """
    return _interpolates(job) and job.count < _FEWEST and not job.settings.denoise


def _interpolates(job: SolveJob) -> bool:
    settings = job.settings
    return (
        settings.adaptive
        and job.remote is None
        and job.compute is not None
        and job.compute.processor
        and settings.has_indirect
        and settings.patch_groups != 1
        and job.patch_scene.sides is None
        and settings.method in ("auto", "cached")
    )


def group_width(job: SolveJob) -> tuple[int, tuple[str, ...]]:
    """Return the width of patch groups in texels, 1 for none, and the reasons."""
    settings, count = job.settings, job.count
    if job.compute is None or settings.method == "paper" or not settings.has_indirect:
        return 1, ()
    if job.patch_scene.sides is not None:
        return 1, ("Every patch is solved separately: some surfaces are translucent.",)
    if settings.patch_groups:
        return settings.patch_groups, ("The settings request patch groups.",)
    if is_adaptive(job):
        reason = f"Groups of {_GROUP_WIDTH} x {_GROUP_WIDTH} texels are solved as one, with more rays each."
        return _GROUP_WIDTH, (reason,)
    if job.remote is not None:
        width = shared_width(settings, count)
        reason = (
            f"Groups of {width} x {width} texels are solved as one: each worker receives the light of all "
            f"{count:,} texels."
        )
        return width, (reason,) if width > 1 else ()
    needed = expected_samples(settings) * count * sample_bytes(count, job.patch_scene.cutouts.tinted)
    if settings.method != "auto" or needed <= memory_budget(job):
        return 1, ()
    reason = (
        f"Groups of {_GROUP_WIDTH} x {_GROUP_WIDTH} texels are solved as one: {memory_clause(job, needed)}."
    )
    return _GROUP_WIDTH, (reason,)


def shared_width(settings: Settings, count: int) -> int:
    """Return the width of groups of `count` patches where other processes gather, texels; 1 for none."""
    if not settings.has_indirect:
        return 1
    if settings.patch_groups:
        return settings.patch_groups
    return _GROUP_WIDTH if settings.method == "auto" and count > _MOST_SHARED else 1


def memory_clause(job: SolveJob, needed: int) -> str:
    """Return a clause with the memory that samples need, bytes, and the budget."""
    budget = memory_budget(job)
    return f"visibility data needs {needed / 2**20:,.0f} MiB, the limit is {budget / 2**20:,.0f} MiB"
