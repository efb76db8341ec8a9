"""Materials of hair: strands have no UVs, so that textures are replaced by their means."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....engine.scene.color import srgb_to_linear
from ....engine.scene.model import Material
from ....engine.scene.texture import Texture
from ....engine.scene.transmission import Transmission, Transmittance


def without_textures(material: Material) -> Material:
    """Return a material with the means of its textures as constants, and the back equal to the front."""
    sides = material.transmission
    return replace(
        material,
        reflectance=material.reflectance * _mean(material.reflectance_map),
        reflectance_map=None,
        emission=material.emission * _mean(material.emission_map),
        emission_map=None,
        translucency=material.translucency * _mean(material.translucency_map),
        translucency_map=None,
        transmission=Transmission(_mean_transmittance(sides.shadow), _mean_transmittance(sides.bounce)),
        back=None,
    )


def _mean(texture: Texture | None) -> np.ndarray:
    """Return the mean colour of a texture, (c,) float32 linear; 1 without one."""
    if texture is None:
        return np.ones(1, np.float32)
    pixels = srgb_to_linear(texture.pixels) if texture.srgb else texture.pixels
    return pixels.mean(axis=(0, 1), dtype=np.float64).astype(np.float32)


def _mean_transmittance(side: Transmittance) -> Transmittance:
    """Return the mean of a transmittance over its texture."""
    if side.texture is None:
        return side
    pixels = side.offset + side.scale * side.texture.pixels
    if side.threshold is not None:
        pixels = (1 - pixels < side.threshold).astype(np.float32)
    mean = pixels.mean(axis=(0, 1), dtype=np.float64).astype(np.float32)
    return Transmittance(mean, fresnel=None if side.threshold is not None else side.fresnel)
