"""Straight-through transmittance of a surface: RGB, by side and kind of ray."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .texture import Texture

#: Values of `Fresnel.body`.
FRONT, BACK = 1, 2


@dataclass(frozen=True)
class Fresnel:
    """Loss of transmittance with the angle of incidence, for smooth glass.

    ior:    index of refraction, relative to the medium outside
    share:  fraction of the transmittance at normal incidence that passes glass; the rest has no loss
    faces:  faces of glass that light crosses at this surface: 2 for thin walls, otherwise 1
    body:   FRONT or BACK of a closed body, 0 for other surfaces; see `body_transmittance`
    """

    ior: float
    share: float = 1.0
    faces: float = 1.0
    body: int = 0


@dataclass(frozen=True)
class Transmittance:
    """Fraction of light that passes straight through one side at normal incidence: offset + scale * texture.

    offset:     (3,) float32; the transmittance itself without a texture
    scale:      (3,) float32, factor of the texture
    texture:    texture with 1 or 3 linear channels, or None
    threshold:  opacity (1 - transmittance) at or above it becomes 1, below it 0; None for no threshold
    fresnel:    loss with the angle of incidence; None for equal transmittance at all angles. Not applied with
                a threshold
    """

    offset: np.ndarray = field(default_factory=lambda: np.zeros(3, np.float32))
    scale: np.ndarray = field(default_factory=lambda: np.zeros(3, np.float32))
    texture: Texture | None = None
    threshold: float | None = None
    fresnel: Fresnel | None = None

    @property
    def passes(self) -> bool:
        """True if light can pass."""
        return bool(self.offset.any() or self.scale.any())


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


def fresnel_reflectance(cosine: np.ndarray | float, ior: float) -> np.ndarray:
    """Return the unpolarised Fresnel reflectance of a dielectric surface; 1 under total reflection.

    The formula is the same as in Cycles (kernel/closure/bsdf_util.h, `fresnel_dielectric_cos`).

    cosine:  cosines of the angles of incidence, 0..1
    """
    c = np.asarray(cosine, np.float64)
    squared = ior * ior - 1 + c * c
    g = np.sqrt(np.maximum(squared, 0))
    first = (g - c) / (g + c)
    second = (c * (g + c) - 1) / np.where(c * (g - c) == -1, 1, c * (g - c) + 1)
    reflectance: np.ndarray = np.where(squared > 0, 0.5 * first**2 * (1 + second**2), 1.0)
    return reflectance


def angular_factor(fresnel: Fresnel, cosine: np.ndarray | float) -> np.ndarray:
    """Return the transmittance at an angle of incidence, relative to normal incidence.

    A face of glass transmits sqrt((1 - F) / (1 + F)). Two faces, a slab, transmit (1 - F) / (1 + F): that is
    1 - F squared, plus the light of all reflections between the faces.

    cosine:  cosines of the angles of incidence, 0..1
    """
    reflected, normal = fresnel_reflectance(cosine, fresnel.ior), fresnel_reflectance(1.0, fresnel.ior)
    passed = (1 - reflected) * (1 + normal) / np.maximum((1 + reflected) * (1 - normal), 1e-30)
    factor: np.ndarray = 1 - fresnel.share * (1 - passed ** (0.5 * fresnel.faces))
    return factor


def body_transmittance(passed: np.ndarray, body: int) -> np.ndarray:
    """Return the transmittance of a side of a closed body, from the transmittance T of a face.

    The front transmits (1 + T^2) / 2 and the back 2 T^2 / (1 + T^2): together T^2, as two faces. The opaque
    part of the front, (1 - T^2) / 2, is then half of what a slab reflects at each angle.
    """
    if body == 0:
        return passed
    squared = passed**2
    return (1 + squared) / 2 if body == FRONT else 2 * squared / (1 + squared)


def mean_angular_factor(fresnel: Fresnel) -> float:
    """Return the mean of `angular_factor` under uniform light, weighted by the cosine."""
    steps = 256
    squared = (np.arange(steps) + 0.5) / steps
    return float(angular_factor(fresnel, np.sqrt(squared)).mean())
