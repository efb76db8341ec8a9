"""Straight-through transmittance of a surface: RGB, by side and kind of ray."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .texture import Texture


@dataclass(frozen=True)
class Transmittance:
    """Fraction of light that passes straight through one side: offset + scale * texture.

    offset:     (3,) float32; the transmittance itself without a texture
    scale:      (3,) float32, factor of the texture
    texture:    texture with 1 or 3 linear channels, or None
    threshold:  opacity (1 - transmittance) at or above it becomes 1, below it 0; None for no threshold
    """

    offset: np.ndarray = field(default_factory=lambda: np.zeros(3, np.float32))
    scale: np.ndarray = field(default_factory=lambda: np.zeros(3, np.float32))
    texture: Texture | None = None
    threshold: float | None = None


#: Transmittance of an opaque surface.
OPAQUE = Transmittance()

#: Transmittance of a fully clear surface.
CLEAR = Transmittance(np.ones(3, np.float32))


def from_opacity(
    opacity: float, texture: Texture | None = None, threshold: float | None = None
) -> Transmittance:
    """Return the grey transmittance 1 - opacity * texture."""
    if texture is None:
        return Transmittance(np.full(3, 1 - opacity, np.float32), threshold=threshold)
    return Transmittance(np.ones(3, np.float32), np.full(3, -opacity, np.float32), texture, threshold)


@dataclass(frozen=True)
class Transmission:
    """Transmittance of both sides of a surface.

    shadow:       front, for shadow rays to lights and the sky's sun
    bounce:       front, for gathered light, sampled emission, sampled sky and ambient occlusion
    shadow_back:  back, like `shadow`; None if equal to the front
    bounce_back:  back, like `bounce`; None if equal to the front
    """

    shadow: Transmittance = OPAQUE
    bounce: Transmittance = OPAQUE
    shadow_back: Transmittance | None = None
    bounce_back: Transmittance | None = None
