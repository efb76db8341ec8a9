"""Choice of the visibility sampler, and a timed trial of rays on some patches of the scene."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from ..device.opencl import cl
from ..gather.visibility_cache import BackfaceLight
from ..settings import Settings
from ..visibility.raster.raster_sampler import RasterSampler
from ..visibility.rays.ray_sampler import RaySampler
from ..visibility.sampler import VisibilitySampler
from .memory import device_budget, visibility_passes
from .solve_job import SolveJob

#: Names of the visibility samplers.
SAMPLERS = ("rays", "raster")

#: Minimum number of patches of the first trial, and of its rays on a GPU, which fewer do not fill (chosen).
#: Growth factor of the next ones, and duration in seconds that ends the trial.
_TRIED, _FULL, _MORE, _LONG_ENOUGH = 32, 1 << 17, 8, 0.01

#: Time in seconds: if rays for all patches take less by the first run, the trial ends.
_SHORT = 0.5


def make_sampler(job: SolveJob, visibility: str) -> VisibilitySampler:
    """Return the visibility sampler "rays" or "raster"."""
    return _makers(job)[visibility]()


def untried_visibility(settings: Settings) -> str:
    """Return the name of the sampler if no trial runs: rays unless the settings say raster."""
    return "raster" if settings.visibility == "raster" else "rays"


def choose_sampler(job: SolveJob) -> tuple[VisibilitySampler, list[str], float]:
    """Return the visibility sampler, its reasons, and the time of a sample, s; NaN if not timed.

    The sampler casts rays unless the settings request drawn hemicubes, which see from the centre of a texel
    only. Speed does not decide, since it depends on the load of the machine.
    """
    wanted, makers = job.settings.visibility, _makers(job)
    if wanted != "auto":
        why = (
            "Some surfaces are tinted, which requires rays."
            if job.patch_scene.cutouts.tinted
            else f"The settings request {wanted}."
        )
        return makers[wanted](), [why], math.nan
    sampler = makers["rays"]()
    rate = _patches_per_second(job, sampler)
    why = f"Rays sample {rate:,.0f} texels per second ({sampler.samples} samples)."
    return sampler, [why], 1 / (rate * sampler.samples)


def _makers(job: SolveJob) -> dict[str, Callable[[], VisibilitySampler]]:
    """Return a constructor for each sampler by name."""
    return {
        "rays": lambda: RaySampler(job.opencl, job.rays, job.patch_scene, job.background, job.settings),
        "raster": lambda: RasterSampler(
            job.graphics, job.opencl, job.patch_scene, job.background, job.settings
        ),
    }


def _patches_per_second(job: SolveJob, sampler: VisibilitySampler) -> float:
    """Return the patches per second of rays, timed on growing numbers of patches.

    Fixed overhead is subtracted. The trial ends early if all patches take only a moment.
    """
    largest = min(job.opencl.device.max_mem_alloc_size, device_budget(job)) // sampler.row_bytes
    full = 0 if job.opencl.processor else _FULL
    tried = min(max(_TRIED, full // sampler.samples), job.count)
    largest, before = min(job.count, max(_TRIED, largest)), (0, 0.0)
    tried = min(tried, largest)
    views = job.count * visibility_passes(job, sampler)

    # A first run that is slow may include loading of the kernel, so it does not count.
    backs = BackfaceLight(job.opencl, job.count, len(job.emission), job.settings.directional)
    seconds = _time(job, sampler, backs, tried)
    if seconds * views < _SHORT * tried:
        return tried / seconds
    while True:
        seconds = _time(job, sampler, backs, tried)
        if seconds > _LONG_ENOUGH or tried == largest or seconds * views < _SHORT * (tried - before[0]):
            return (tried - before[0]) / max(seconds - before[1], seconds / 4)
        before = tried, seconds
        tried = min(tried * _MORE, largest)


def _time(job: SolveJob, sampler: VisibilitySampler, backs: BackfaceLight, tried: int) -> float:
    """Return the time for the samples of `tried` patches in the middle of the list, s.

    backs:  buffers for the light of back faces, whose contents do not matter
    """
    compute, first = job.opencl, (job.count - tried) // 2
    cache = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, sampler.row_bytes * tried)
    began = time.perf_counter()
    for _ in sampler.find(first, first + tried, backs.found_with(cache, first)):
        pass
    compute.queue.finish()
    return time.perf_counter() - began
