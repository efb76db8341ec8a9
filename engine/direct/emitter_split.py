"""A scene's light in two parts: what is sampled with shadow rays, and what hemicubes see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..patches.patch_scene import Subdivision
from ..settings import Settings
from .emitters import BrightTriangles, bright_triangles, no_bright_triangles
from .sky import Sky, split_sky, whole_sky


@dataclass(frozen=True)
class SplitLight:
    """Small bright surfaces and bright sky apart from all other light that is emitted; lamps are neither."""

    bright: BrightTriangles
    sky: Sky


def split_light(
    world: np.ndarray,
    parts: Subdivision,
    settings: Settings,
    bright: Callable[[Subdivision], BrightTriangles] = bright_triangles,
    split: Callable[[np.ndarray], Sky] = split_sky,
) -> SplitLight:
    """Split the light of surfaces and of a world, unless hemicubes are to see everything as in the paper.

    bright  chooses the triangles that are sampled
    split   parts the world
    """
    chosen = bright(parts) if settings.sample_emission else no_bright_triangles(parts)
    return SplitLight(chosen, sky_of(world, settings, split))


def sky_of(world: np.ndarray, settings: Settings, split: Callable[[np.ndarray], Sky] = split_sky) -> Sky:
    """Return both parts of a world; split: see `split_light`."""
    return split(world) if settings.sample_emission else Sky(whole_sky(world), None)
