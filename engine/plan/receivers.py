"""Points that gather once light has settled: patches after groups of them were solved, points of texels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..gather.gather_pass import GatherPass, PointGather
from ..gather.remote_gather import RemoteGatherPass
from ..patches.patch_scene import PatchScene
from ..settings import Settings
from ..solve.final_gather import FinalGather
from ..visibility.rays.ray_scene import RayScene
from .choose_gather import stream_sweep
from .solve_job import SolveJob
from .solver_choice import SolverChoice
from .visibility_trial import make_sampler


@dataclass(frozen=True)
class Receivers:
    """Points that gather once light has settled: patches, or points of texels.

    sampled_light  (n, 3) float32, E/pi of the light that shadow rays sample
    """

    parts: PatchScene
    rays: RayScene
    sampled_light: np.ndarray


def make_final_gather(
    solved: SolveJob, choice: SolverChoice, receivers: Receivers, settings: Settings
) -> tuple[FinalGather, int]:
    """Return what gathers from the patches of a job, and how many samples it takes of all receivers together.

    The receivers look for themselves, but see the patches of the job.
    """
    final: PointGather
    if solved.remote is not None:
        lit = receivers.sampled_light
        final, samples = RemoteGatherPass(solved.opencl, solved.remote, lit, solved.count), choice.samples
    else:
        final, samples = final_gather(solved, choice.visibility, receivers, settings)
    reflectance = solved.parts.surfaces.reflectance
    last = FinalGather(
        final,
        receivers.sampled_light,
        solved.emission,
        reflectance,
        settings.has_indirect,
        separates_direct(solved, settings),
    )
    return last, last.gathers * len(receivers.sampled_light) * samples


def final_gather(
    solved: SolveJob, visibility: str, receivers: Receivers, settings: Settings
) -> tuple[GatherPass, int]:
    """Return what gathers on this device from the patches of a job, and the samples of each receiver."""
    lookers = looking(solved, receivers, settings)
    identity = make_sampler(lookers, visibility)
    final = GatherPass(solved.opencl, stream_sweep(lookers, identity), receivers.sampled_light)
    return final, identity.samples


def looking(solved: SolveJob, receivers: Receivers, settings: Settings) -> SolveJob:
    """Return what receivers look for that see the patches of a job."""
    parts = solved.parts.seen_from(receivers.parts.patches, receivers.parts.geometry)
    return replace(
        solved,
        parts=parts,
        rays=receivers.rays,
        sampled_light=receivers.sampled_light,
        settings=settings,
    )


def separates_direct(solved: SolveJob, settings: Settings) -> bool:
    """Return whether what is gathered before any bounce is an output, or a part of one."""
    return solved.gathers_direct and not {"direct", "indirect"}.isdisjoint(settings.outputs)
