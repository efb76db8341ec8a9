"""A scene's light in two parts: what is sampled with shadow rays, and what hemicubes see."""

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
    """Small bright surfaces and bright sky apart from all other light that is emitted; lamps are neither."""

    bright: SampledTriangles
    sky: Sky


def split_light(
    world: np.ndarray,
    parts: PatchScene,
    settings: Settings,
    bright: Callable[[PatchScene], SampledTriangles] = choose_sampled_triangles,
    split: Callable[[np.ndarray], Sky] = split_sky,
) -> EmitterSplit:
    """Split the light of surfaces and of a world, unless hemicubes are to see everything as in the paper.

    bright  chooses the triangles that are sampled
    split   parts the world
    """
    chosen = bright(parts) if settings.sample_emission else no_bright_triangles(parts)
    return EmitterSplit(chosen, sky_of(world, settings, split))


def sky_of(world: np.ndarray, settings: Settings, split: Callable[[np.ndarray], Sky] = split_sky) -> Sky:
    """Return both parts of a world; split: see `split_light`."""
    return split(world) if settings.sample_emission else Sky(unsampled_sky(world), None)
