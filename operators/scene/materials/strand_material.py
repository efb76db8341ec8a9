"""Materials of hair: strands have no UVs, so that the mean of a texture stands for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....engine.scene.color import srgb_to_linear
from ....engine.scene.model import Material
from ....engine.scene.texture import Texture


def without_textures(material: Material) -> Material:
    """Return a material with constants in place of its textures."""
    return replace(
        material,
        reflectance=material.reflectance * _mean(material.reflectance_map),
        reflectance_map=None,
        emission=material.emission * _mean(material.emission_map),
        emission_map=None,
        alpha=material.alpha * float(_mean(material.alpha_map).mean()),
        alpha_map=None,
    )


def _mean(texture: Texture | None) -> np.ndarray:
    """Return the mean color of a texture, (c,) float32; 1 without one."""
    if texture is None:
        return np.ones(1, np.float32)
    pixels = srgb_to_linear(texture.pixels) if texture.srgb else texture.pixels
    return pixels.mean(axis=(0, 1), dtype=np.float64).astype(np.float32)
