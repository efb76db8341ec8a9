"""Final gather points: patches after their groups are solved, or texel samples."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..gather.gather_pass import GatherPass
from ..gather.interface import PointGather
from ..gather.remote_gather import RemoteGatherPass
from ..patches.patch_scene import PatchScene
from ..settings import Settings
from ..solve.final_gather import FinalGather
from ..visibility.rays.ray_scene import RayScene
from .choose_gather import stream_gather
from .solve_job import SolveJob
from .solver_choice import SolverChoice
from .visibility_trial import make_sampler


@dataclass(frozen=True)
class Receivers:
    """Points of a final gather: patches or texel samples.

    patch_scene:    points as patches, with the scene's triangles
    rays:           ray tracer with the points as origins
    sampled_light:  (n, 3) float32, E/pi of light from shadow rays
    """

    patch_scene: PatchScene
    rays: RayScene
    sampled_light: np.ndarray


def make_final_gather(
    solved: SolveJob, choice: SolverChoice, receivers: Receivers, settings: Settings
) -> tuple[FinalGather, int]:
    """Return the final gather from the patches of a job, and the number of samples of all receivers.

    The receivers trace their own rays; the rays return patches of the job.
    """
    final: PointGather
    if solved.remote is not None:
        sampled = receivers.sampled_light
        final, samples = RemoteGatherPass(solved.opencl, solved.remote, sampled, solved.count), choice.samples
    else:
        final, samples = final_gather(solved, choice.visibility, receivers, settings)
    reflectance = solved.patch_scene.surfaces.reflectance
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
    """Return the gather pass on this device, and the samples of each receiver."""
    job = receiver_job(solved, receivers, settings)
    sampler = make_sampler(job, visibility)
    final = GatherPass(solved.opencl, stream_gather(job, sampler), receivers.sampled_light)
    return final, sampler.samples


def receiver_job(solved: SolveJob, receivers: Receivers, settings: Settings) -> SolveJob:
    """Return a job whose rays start at the receivers and hit patches of `solved`."""
    patch_scene = solved.patch_scene.seen_from(receivers.patch_scene.patches, receivers.patch_scene.geometry)
    return replace(
        solved,
        patch_scene=patch_scene,
        rays=receivers.rays,
        sampled_light=receivers.sampled_light,
        settings=settings,
    )


def separates_direct(solved: SolveJob, settings: Settings) -> bool:
    """Return True if an output needs the light before any bounce separately."""
    return solved.gathers_direct and not {"direct", "indirect"}.isdisjoint(settings.outputs)
