"""Split of a scene's emission: a part sampled by shadow rays, and the rest for the gather."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..patches.patch_scene import PatchScene
from ..settings import Settings
from .emitters import SampledTriangles, choose_sampled_triangles, no_bright_triangles
from .sky import Sky, split_sky, unsampled_sky


@dataclass(frozen=True)
class EmitterSplit:
    """Bright surfaces that shadow rays sample, and both parts of the sky; without light objects."""

    bright: SampledTriangles
    sky: Sky


def split_light(
    world: np.ndarray,
    patch_scene: PatchScene,
    settings: Settings,
    bright: Callable[[PatchScene], SampledTriangles] = choose_sampled_triangles,
    split: Callable[[np.ndarray], Sky] = split_sky,
) -> EmitterSplit:
    """Split emission of surfaces and world into a part for shadow rays and the rest for the gather.

    If `Settings.sample_emission` is off, the gather handles all of it.

    bright:  chooses the triangles to sample
    split:   splits the world
    """
    chosen = bright(patch_scene) if settings.sample_emission else no_bright_triangles(patch_scene)
    return EmitterSplit(chosen, sky_of(world, settings, split))


def sky_of(world: np.ndarray, settings: Settings, split: Callable[[np.ndarray], Sky] = split_sky) -> Sky:
    """Split a world's radiance into the part for the gather and the bright part, which shadow rays sample."""
    return split(world) if settings.sample_emission else Sky(unsampled_sky(world), None)
