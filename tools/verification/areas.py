"""Cycles' light over whole texels: the mean of 4 x 4 smaller texels on surfaces.

Cycles bakes the face at a texel's centre. A texel stands for all that surfaces cover of it.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass, replace

import numpy as np

from tools.headless import MODULE
from tools.verification.block_means import block_means, block_shares
from tools.verification.cycles import realised
from tools.verification.difference import weight_of
from tools.verification.doubled import doubled_texels

#: Width of a texel, in those that Cycles bakes of it.
FINER = 4

#: Number of rays by which fine texels are tested for the inside of geometry.
_LOOKS = 64


@dataclass(frozen=True)
class TexelAreas:
    """Means over what is known of texels.

    bakes:  two independent ones of Cycles, (atlases, h, w, 4) float32: alpha is 0 where nothing is known
    share:  (atlases, h, w, 3) float32, the part of a texel that each channel is known of
    """

    bakes: tuple[np.ndarray, np.ndarray]
    share: np.ndarray


def bake_areas(context, read, settings, samples: int, group: str | None = None) -> TexelAreas:
    """Bake with Cycles, `samples` in each texel.

    read, settings: the engine's scene as it was read, and the settings of its bake.
    group: name of the light group whose light is baked; None for all light
    """
    fine = replace(settings, resolution=FINER * settings.resolution)
    with realised(context, read, fine.resolution) as reference:
        if group is not None:
            reference.keep_group(group)
        count = -(-samples // FINER**2)
        bakes = reference.bake(count, 1), reference.bake(count, 2)
        colour = reference.colour()
    visible = visible_texels(read.scene, fine) & (bakes[0][..., 3] > 0)
    known = visible[..., None] & (weight_of(colour) > 0)
    share = block_shares(known, FINER)
    first, second = (_with_alpha(block_means(bake[..., :3], known, FINER), share) for bake in bakes)
    return TexelAreas((first, second), share)


def _with_alpha(means: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return means, (atlases, h, w, 4), with an alpha of 0 where no channel is known."""
    return np.concatenate([means, share.max(axis=-1, keepdims=True) > 0], axis=-1)


def visible_texels(scene, settings) -> np.ndarray:
    """Return the texels, (atlases, h, w) bool, whose centres are seen and lie on one surface only."""
    engine = importlib.import_module(f"{MODULE}.engine")
    looking = replace(
        settings, outputs=("direct",), visibility="rays", samples=_LOOKS, light_samples=1, texel_samples=1,
        hide_seams=False, margin=0, intermediates=False,
    )  # fmt: skip
    lightmap = engine.finished(engine.bake(scene, looking))
    doubled = doubled_texels(subdivided(scene, settings), len(scene.atlases))
    return lightmap.has_patch & lightmap.known & ~doubled


def subdivided(scene, settings):
    """Return the patches of a scene as a bake has them."""
    engine = importlib.import_module(f"{MODULE}.engine")
    names = ("device.gl_context", "patches.backs", "patches.patch_scene")
    gl_context, backs, patch_scene = (importlib.import_module(f"{engine.__name__}.{name}") for name in names)
    context = gl_context.GraphicsContext()
    try:
        placed = backs.with_places(scene, settings.resolution)
        return patch_scene.make_patch_scene(context, None, placed, settings)
    finally:
        context.release()
