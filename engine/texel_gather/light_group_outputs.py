"""Light group maps at patches and at texel samples."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ..patches.sides import both_sides
from ..postprocess.output_names import light_group_maps
from ..progress import run_as_fraction
from ..solve.solution import Solution
from .light_group_solver import GroupEmission, solve_light_groups
from .texel_sample_gather import TexelSampleLight, light_groups_in_texels
from .texel_sample_points import TexelGatherJob

#: Maps by name: E/pi of patches or samples, (n, 3) float32.
Maps = dict[str, np.ndarray]


def light_by_groups(
    texel_job: TexelGatherJob, solution: Solution, lit: TexelSampleLight
) -> Generator[float, None, tuple[Maps, Maps]]:
    """Return the light group maps of patches, and of texel samples if there are any.

    Yields the fraction done.
    """
    if not texel_job.job.settings.by_light_groups:
        return {}, {}
    names = light_group_maps(texel_job.scene)
    if texel_job.choice.method == "none":
        return {name: np.zeros((texel_job.job.count, 3), np.float32) for name in names}, {}
    sampled = yield from run_as_fraction(0.0, 0.1, texel_job.lighting.gather_by_group())
    sampled = np.stack([both_sides(texel_job.job.patch_scene.sides, light) for light in sampled])
    left = map(texel_job.lighting.left_to_hemicubes, range(len(names)))
    sources = [
        GroupEmission(emission, sky, light, backs)
        for (emission, sky, backs), light in zip(left, sampled, strict=True)
    ]
    solving = solve_light_groups(texel_job.job, texel_job.solved, texel_job.choice, solution, sources)
    groups = yield from run_as_fraction(0.1, 0.6, solving)
    patches = {name: group.irradiance for name, group in zip(names, groups, strict=True)}
    samples = yield from run_as_fraction(0.6, 1.0, light_groups_in_texels(texel_job, lit, groups))
    return patches, dict(zip(names, samples, strict=False))
