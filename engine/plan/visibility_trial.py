"""Timed trial of the visibility samplers "rays" and "raster" on some patches of the scene."""

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
from .rates import DrawingRates, hemicubes_bound
from .solve_job import SolveJob

#: Names of the visibility samplers.
SAMPLERS = ("rays", "raster")

#: Minimum number of patches of the first trial, and of its rays on a GPU, which fewer do not fill (chosen).
#: Growth factor of the next ones, and duration in seconds that ends the trial.
_TRIED, _FULL, _MORE, _LONG_ENOUGH = 32, 1 << 17, 8, 0.01

#: Time in seconds: if rays for all patches take less, raster is not tried, since the trial would take as
#: long.
_SHORT = 0.5

#: Raster is not tried if rays are this many times as fast as the fastest possible raster on this device.
_CLEARLY = 4


def make_sampler(job: SolveJob, visibility: str) -> VisibilitySampler:
    """Return the visibility sampler "rays" or "raster"."""
    return _makers(job)[visibility]()


def untried_visibility(settings: Settings) -> str:
    """Return the name of the sampler if no trial runs: rays unless the settings say raster."""
    return "raster" if settings.visibility == "raster" else "rays"


def choose_sampler(job: SolveJob) -> tuple[VisibilitySampler, list[str], float]:
    """Choose the visibility sampler; return it, the reasons, and the time of a sample, s (NaN untimed).

    If the settings allow both, the faster one on a few patches of the scene is chosen.
    """
    wanted, makers = job.settings.visibility, _makers(job)
    if wanted != "auto":
        why = (
            "Some surfaces are tinted, which requires rays."
            if job.patch_scene.cutouts.tinted
            else f"The settings request {wanted}."
        )
        return makers[wanted](), [why], math.nan
    tried: dict[str, VisibilitySampler] = {}
    rates: dict[str, float] = {}
    reason_to_stop = ""
    for name, make in makers.items():
        tried[name] = make()
        rates[name] = _patches_per_second(job, tried[name])
        reason_to_stop = _why_alone(job, tried[name], rates[name])
        if reason_to_stop:
            break
    best = max(rates, key=lambda name: rates[name])
    summary = " and ".join(
        f"{name} {rate:,.0f} ({tried[name].samples} samples)" for name, rate in rates.items()
    )
    reasons = [f"Patches sampled per second: {summary}."]
    if reason_to_stop and len(tried) < len(makers):
        reasons.append(f"No other method was tried: {reason_to_stop}.")
    if "raster" in rates:
        drawing, texels = _drawing_rates(job)
        drawing.record(len(job.patch_scene.triangles.positions), rates["raster"] * texels)

    # Release the memory of the rejected sampler.
    chosen = tried.pop(best)
    tried.clear()
    job.graphics.collect()
    return chosen, reasons, 1 / (rates[best] * chosen.samples)


def _why_alone(job: SolveJob, sampler: VisibilitySampler, rate: float) -> str:
    """Return the reason not to try raster, given a rate in patches per second; empty if it is tried."""
    if rate * _SHORT > job.count * visibility_passes(job, sampler):
        return f"{sampler.name} need {job.count / rate:.2g} s for all texels"
    (drawing, texels), triangles = _drawing_rates(job), len(job.patch_scene.triangles.positions)
    drawn = min(drawing.bound(triangles) / texels, hemicubes_bound(job.graphics.name, triangles))
    if rate > _CLEARLY * drawn:
        return f"raster reaches at most {drawn:,.0f} on this device"
    return ""


def _drawing_rates(job: SolveJob) -> tuple[DrawingRates, int]:
    """Return the recorded raster rates for this hemicube width, and the texels of each hemicube."""
    settings = job.settings
    rates = DrawingRates(settings.cache_dir, job.graphics.name, settings.hemicube)
    return rates, 3 * settings.hemicube**2


def _makers(job: SolveJob) -> dict[str, Callable[[], VisibilitySampler]]:
    """Return a constructor for each sampler by name, the sampler with the shorter trial first."""
    return {
        "rays": lambda: RaySampler(job.opencl, job.rays, job.patch_scene, job.background, job.settings),
        "raster": lambda: RasterSampler(
            job.graphics, job.opencl, job.patch_scene, job.background, job.settings
        ),
    }


def _patches_per_second(job: SolveJob, sampler: VisibilitySampler) -> float:
    """Return the patches per second of a sampler, timed on growing numbers of patches.

    Fixed overhead, such as the copy of a whole batch of hemicubes, is subtracted. The trial ends early if all
    patches take only a moment.
    """
    largest = min(job.opencl.device.max_mem_alloc_size, device_budget(job)) // sampler.row_bytes
    fills = isinstance(sampler, RaySampler) and not job.opencl.processor
    tried = min(max(_TRIED, fills * _FULL // sampler.samples), job.count)
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
