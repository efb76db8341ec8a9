"""Independent low-sample gather of all patches, used to weight the denoiser."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

import numpy as np

from ..device.device_array import Values
from ..patches.sides import both_sides
from ..plan.receivers import Receivers, make_final_gather
from ..postprocess.output_maps import light_output
from ..progress import run_as_fraction
from ..settings import Settings
from ..solve.solution import Solution
from ..visibility.sample_counts import ray_count
from .texel_sample_points import TexelGatherJob
from .valid_patches import radiance_of

#: Number of visibility rays per patch, and of shadow rays per light and patch.
_RAYS, _LIGHT_RAYS = 32, 16

#: Bits that change the seed, so that the noise is uncorrelated with the bake's.
_OTHER = 0x9E3779B9


def gather_independent_estimate(
    texel_job: TexelGatherJob, solution: Solution
) -> Generator[float, None, tuple[dict[str, Values], float]]:
    """Return independent light outputs, (n, 3) float32 by name, and their fraction of all rays.

    Yields the fraction done. Returns no outputs without OpenCL, with the paper's method, and where other
    processes gather.
    """
    job = texel_job.job
    if job.compute is None or job.remote is not None or texel_job.choice.method in ("none", "paper"):
        return {}, 0.0
    settings = _few_rays(job.settings)
    lighting = texel_job.lighting.of(job.rays, settings)
    sampled = yield from run_as_fraction(0.0, 0.5, lighting.gather())
    last, _ = make_final_gather(
        texel_job.solved, texel_job.choice, Receivers(job.patch_scene, job.rays, sampled), settings
    )
    radiance = radiance_of(texel_job.solved, solution.source_irradiance, solution.substitute)
    yield from run_as_fraction(0.5, 1.0, last.gather_from(radiance))
    rays = ray_count(settings)
    outputs = {name: light_output(name, last) for name in job.settings.light_outputs}
    sides = job.patch_scene.sides
    light: dict[str, Values] = {
        name: both_sides(sides, np.asarray(values)) if sides else values for name, values in outputs.items()
    }
    return light, rays / (rays + ray_count(job.settings))


def _few_rays(settings: Settings) -> Settings:
    """Return the settings of the independent gather.

    The number of rays differs from the bake's, since shifted sequences of equal length have correlated
    errors.
    """
    rays, light_rays = ray_count(settings), settings.light_samples
    return replace(
        settings,
        samples=_RAYS if rays > _RAYS else rays + 4,
        hemicube=8,
        light_samples=_LIGHT_RAYS if light_rays > _LIGHT_RAYS else light_rays + 1,
        seed=settings.seed ^ _OTHER,
    )
