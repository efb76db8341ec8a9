"""Straight-through transmittance of a surface: RGB, for each side and for each kind of ray."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .texture import Texture


@dataclass(frozen=True)
class Transmittance:
    """Fraction of light that passes straight through one side of a surface: offset + scale * texture.

    offset     (3,) float32; without a texture it is the transmittance itself
    scale      (3,) float32, factor of the texture
    texture    1 or 3 linear channels, or None
    threshold  opacity (1 - transmittance) at or above it is 1, below it 0; None leaves it as it is
    """

    offset: np.ndarray = field(default_factory=lambda: np.zeros(3, np.float32))
    scale: np.ndarray = field(default_factory=lambda: np.zeros(3, np.float32))
    texture: Texture | None = None
    threshold: float | None = None


#: Stops all light.
OPAQUE = Transmittance()

#: Stops no light.
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

    shadow, bounce            front: for shadow rays to lights and the sky's sun; for gathered light, sampled
                              emission, sampled sky and ambient occlusion
    shadow_back, bounce_back  the same for the back; None is as the front
    """

    shadow: Transmittance = OPAQUE
    bounce: Transmittance = OPAQUE
    shadow_back: Transmittance | None = None
    bounce_back: Transmittance | None = None


def uniform_transmission(transmittance: Transmittance) -> Transmission:
    """Return the transmission of a surface that passes all kinds of rays alike, from both sides."""
    return Transmission(transmittance, transmittance)
