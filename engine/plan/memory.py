"""How much device memory the samples of patches take: whether they are kept, or patches form groups."""

from __future__ import annotations

from ..settings import Settings
from ..visibility.sample_counts import most_samples, sample_bytes
from ..visibility.sampler import VisibilitySampler
from .solve_job import SolveJob

#: Width of the squares of patches that are solved as one, texels.
_GROUP_WIDTH = 4

#: Rays of a group where the light between groups is interpolated, as a multiple of those of a patch.
MORE_RAYS = 3

#: Where other processes gather, more patches than this are solved in squares: light of all of them travels
#: to each process in each sweep. No memory decides, so that the bits are the same for any devices.
_MOST_SHARED = 1 << 22

#: Fewer patches than this gather for themselves, all of them: in squares of coarse texels light does not lie
#: in a plane, and what they save is lost by sorting patches. That of single ones lies in one more often.
_FEWEST = 1 << 14


def memory_budget(job: SolveJob) -> int:
    """Return the device memory that the samples of patches may take, bytes: half of it by default."""
    memory = job.opencl.device.global_mem_size
    return min(job.settings.memory_budget or memory // 2, memory)


def is_kept(job: SolveJob, identity: VisibilitySampler) -> bool:
    """Return whether the samples of all patches are kept from the first sweep on."""
    return job.settings.method != "stream" and identity.row_bytes * job.count <= memory_budget(job)


def finding_sweeps(job: SolveJob, identity: VisibilitySampler) -> int:
    """Return how many sweeps find what patches see: the first if it is kept, else every one."""
    return 1 if is_kept(job, identity) else max(2, job.settings.max_bounces)


def is_adaptive(job: SolveJob) -> bool:
    """Return whether only patches that differ from the groups around them gather for themselves.

    A graphics card casts the rays that are saved while the host sorts patches out. What a patch sees is found
    anew where the settings say so.
    """
    return _interpolates(job) and job.count >= _FEWEST


def is_smoothed(job: SolveJob) -> bool:
    """Return whether all patches gather, and then have the light of planes through it where these fit.

    Denoise takes more of a noise that is each patch's own.
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
        and job.parts.sides is None
        and settings.method in ("auto", "cached")
    )


def group_width(job: SolveJob) -> tuple[int, tuple[str, ...]]:
    """Return the width of the squares of patches that are solved as one, texels, and why; 1 for none."""
    settings, count = job.settings, job.count
    if job.compute is None or settings.method == "paper" or not settings.has_indirect:
        return 1, ()
    if job.parts.sides is not None:
        return 1, ("Every patch is solved on its own: some surfaces are translucent.",)
    if settings.patch_groups:
        return settings.patch_groups, ("The settings ask for groups of patches.",)
    if is_adaptive(job):
        reason = f"Squares of {_GROUP_WIDTH} x {_GROUP_WIDTH} patches are solved as one, with more rays each."
        return _GROUP_WIDTH, (reason,)
    if job.remote is not None:
        width = shared_width(settings, count)
        reason = f"Squares of {width} x {width} patches are solved as one: {count:,} share light."
        return width, (reason,) if width > 1 else ()
    needed = most_samples(settings) * count * sample_bytes(count, job.parts.cutouts.tinted)
    if settings.method != "auto" or needed <= memory_budget(job):
        return 1, ()
    reason = (
        f"Squares of {_GROUP_WIDTH} x {_GROUP_WIDTH} patches are solved as one: {memory_clause(job, needed)}."
    )
    return _GROUP_WIDTH, (reason,)


def shared_width(settings: Settings, count: int) -> int:
    """Return the width of the squares of `count` patches where other processes gather, texels; 1 for none."""
    if not settings.has_indirect:
        return 1
    if settings.patch_groups:
        return settings.patch_groups
    return _GROUP_WIDTH if settings.method == "auto" and count > _MOST_SHARED else 1


def memory_clause(job: SolveJob, needed: int) -> str:
    """Return a clause on the memory that samples need, bytes, and what they may take."""
    budget = memory_budget(job)
    return f"what patches see takes {needed / 2**20:,.0f} MiB, {budget / 2**20:,.0f} MiB may be used"
