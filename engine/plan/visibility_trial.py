"""Tries the ways to find what patches see, and times them on the scene itself."""

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
from .memory import finding_sweeps, memory_budget
from .rates import DrawingRates
from .solve_job import SolveJob

#: The ways to find what patches see.
IDENTITIES = ("rays", "raster")

#: Patches that are tried first, how many times more the next try takes, and when a try is long enough, s.
_TRIED, _MORE, _LONG_ENOUGH = 32, 8, 0.01

#: If rays take less than this for all patches, drawing is not tried: the trial would take about as long, s.
_SHORT = 0.5

#: Nor if rays are faster by this factor than drawing ever was on this device.
_CLEARLY = 4


def make_sampler(job: SolveJob, visibility: str) -> VisibilitySampler:
    """Return a way to find what patches see, "rays" or "raster"."""
    return _makers(job)[visibility]()


def untried_visibility(settings: Settings) -> str:
    """Return the way to find what patches see where no trial tells the faster one: rays, unless set."""
    return "raster" if settings.visibility == "raster" else "rays"


def choose_sampler(job: SolveJob) -> tuple[VisibilitySampler, list[str], float]:
    """Return the way to find what patches see, the faster one if the settings leave it open; and why.

    Last comes the time of a sample, s; NaN if nothing was tried.
    """
    wanted, makers = job.settings.visibility, _makers(job)
    if wanted != "auto":
        why = (
            "Surfaces tint light: rays follow it."
            if job.parts.cutouts.tinted
            else f"The settings ask for {wanted}."
        )
        return makers[wanted](), [why], math.nan
    tried: dict[str, VisibilitySampler] = {}
    rates: dict[str, float] = {}
    why_alone = ""
    for name, make in makers.items():
        tried[name] = make()
        rates[name] = _patches_per_second(job, tried[name])
        why_alone = _why_alone(job, tried[name], rates[name])
        if why_alone:
            break
    best = max(rates, key=lambda name: rates[name])
    told = " and ".join(f"{name} {rate:,.0f} ({tried[name].samples} samples)" for name, rate in rates.items())
    reasons = [f"Views of patches found in a second: {told}."]
    if why_alone and len(tried) < len(makers):
        reasons.append(f"Nothing else was tried: {why_alone}.")
    if "raster" in rates:
        drawing, texels = _drawing_rates(job)
        drawing.learn(len(job.parts.triangles.positions), rates["raster"] * texels)

    # The memory of what was rejected is free for the bake.
    chosen = tried.pop(best)
    tried.clear()
    job.graphics.collect()
    return chosen, reasons, 1 / (rates[best] * chosen.samples)


def _why_alone(job: SolveJob, identity: VisibilitySampler, rate: float) -> str:
    """Return why a way that finds `rate` views in a second is not compared with drawing, empty if it is."""
    if rate * _SHORT > job.count * finding_sweeps(job, identity):
        return f"{identity.name} find all of them in {job.count / rate:.2g} s"
    drawing, texels = _drawing_rates(job)
    drawn = drawing.bound(len(job.parts.triangles.positions)) / texels
    if rate > _CLEARLY * drawn:
        return f"drawing has found no more than {drawn:,.0f} on this device"
    return ""


def _drawing_rates(job: SolveJob) -> tuple[DrawingRates, int]:
    """Return how fast hemicubes of a job's width were drawn, and the texels of each."""
    settings = job.settings
    rates = DrawingRates(settings.cache_dir, job.graphics.name, settings.hemicube)
    return rates, 3 * settings.hemicube**2


def _makers(job: SolveJob) -> dict[str, Callable[[], VisibilitySampler]]:
    """Return what makes each way to find what patches see, first the one that is quickly tried."""
    return {
        "rays": lambda: RaySampler(job.opencl, job.rays, job.parts, job.surroundings, job.settings),
        "raster": lambda: RasterSampler(job.graphics, job.opencl, job.parts, job.surroundings, job.settings),
    }


def _patches_per_second(job: SolveJob, identity: VisibilitySampler) -> float:
    """Return how many patches' views an identity finds in a second, timed on more and more of them.

    Fixed overhead, as the copy of a whole batch of hemicubes, is subtracted. Once it shows that all of them
    are found in a moment, nothing longer is tried.
    """
    tried, before = min(_TRIED, job.count), (0, 0.0)
    largest = min(job.opencl.device.max_mem_alloc_size, memory_budget(job)) // identity.row_bytes
    largest = min(job.count, max(tried, largest))
    views = job.count * finding_sweeps(job, identity)
    _time(job, identity, tried)
    while True:
        seconds = _time(job, identity, tried)
        if seconds > _LONG_ENOUGH or tried == largest or seconds * views < _SHORT * (tried - before[0]):
            return (tried - before[0]) / max(seconds - before[1], seconds / 4)
        before = tried, seconds
        tried = min(tried * _MORE, largest)


def _time(job: SolveJob, identity: VisibilitySampler, tried: int) -> float:
    """Return the seconds that the views of some patches in the middle take."""
    compute, first = job.opencl, (job.count - tried) // 2
    cache = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, identity.row_bytes * tried)
    backs = BackfaceLight(compute, job.count, len(job.emission), job.settings.directional)
    began = time.perf_counter()
    for _ in identity.find(first, first + tried, backs.found_with(cache, first)):
        pass
    compute.queue.finish()
    return time.perf_counter() - began
