"""Quantities of a material as constants times textures, with the arithmetic that is exact on them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ....engine.scene.texture import Texture
from ....engine.scene.transmission import Fresnel
from .sockets import ComplexError


@dataclass(frozen=True)
class MaterialValue:
    """A constant, (3,) float64, times a texture if there is one."""

    constant: np.ndarray
    texture: Texture | None = None

    def __mul__(self, other: MaterialValue | float) -> MaterialValue:
        """Return the product; raises ComplexError for two textures."""
        if not isinstance(other, MaterialValue):
            return MaterialValue(self.constant * other, self.texture)
        if self.texture is not None and other.texture is not None:
            raise ComplexError
        return MaterialValue(self.constant * other.constant, self.texture or other.texture)

    def __add__(self, other: MaterialValue) -> MaterialValue:
        """Return the sum; raises ComplexError if there is a texture and neither summand is zero."""
        if self.is_zero:
            return other
        if other.is_zero:
            return self
        if self.texture is not None or other.texture is not None:
            raise ComplexError
        return MaterialValue(self.constant + other.constant)

    @property
    def is_zero(self) -> bool:
        """True if the constant is zero."""
        return not self.constant.any()

    @property
    def number(self) -> float:
        """The value of a constant grey; raises ComplexError for a texture."""
        if self.texture is not None:
            raise ComplexError
        return float(self.constant[0])


def constant(*values: float) -> MaterialValue:
    """Return a constant of one or three channels."""
    return MaterialValue(np.broadcast_to(np.array(values, np.float64), (3,)).copy())


ZERO, ONE = constant(0.0), constant(1.0)


@dataclass(frozen=True)
class DiffuseSurface:
    """A sheet that covers a fraction of the surface; light passes straight through the rest.

    reflect:    diffuse reflectance of the sheet
    emit:       radiance that the sheet emits, W/(m^2 sr)
    transmit:   diffuse transmittance of the sheet
    through:    (3,) float64, straight-through transmittance of the sheet at normal incidence
    glass:      (3,) float64, part of `through` that falls with the angle of incidence
    fresnel:    loss with the angle of incidence, of the largest part of glass; None without glass
    cover:      fraction of the surface that the sheet covers; grey
    threshold:  a cover of at least the threshold becomes 1, and a smaller one 0; None keeps the cover
    """

    reflect: MaterialValue = ZERO
    emit: MaterialValue = ZERO
    transmit: MaterialValue = ZERO
    through: np.ndarray = field(default_factory=lambda: np.zeros(3))
    glass: np.ndarray = field(default_factory=lambda: np.zeros(3))
    fresnel: Fresnel | None = None
    cover: MaterialValue = ONE
    threshold: float | None = None

    @property
    def is_hole(self) -> bool:
        """True if all light passes straight through and nothing is emitted."""
        clear = bool((self.through == 1).all()) and self.threshold is None
        dark = self.reflect.is_zero and self.emit.is_zero and self.transmit.is_zero
        return self.cover.is_zero or (clear and dark)

    def scaled(self, factor: float) -> DiffuseSurface:
        """Return the surface multiplied by a factor, as part of a mix; the other part of the mix is black."""
        return DiffuseSurface(
            self.reflect * factor, self.emit * factor, self.transmit * factor, self.through * factor,
            self.glass * factor, self.fresnel,
        )  # fmt: skip

    def solid(self) -> DiffuseSurface:
        """Return the same surface with a cover of 1; raises ComplexError if the cover has a texture."""
        cover = min(max(self.cover.number, 0.0), 1.0)
        if self.threshold is not None:
            raise ComplexError
        covered = self.scaled(cover)
        return replace(covered, through=covered.through + (1 - cover))

    def __add__(self, other: DiffuseSurface) -> DiffuseSurface:
        """Return the sum of two solid surfaces; raises ComplexError for sums of textures."""
        larger = self if self.glass.sum() >= other.glass.sum() else other
        return DiffuseSurface(
            self.reflect + other.reflect,
            self.emit + other.emit,
            self.transmit + other.transmit,
            self.through + other.through,
            self.glass + other.glass,
            larger.fresnel,
        )


BLACK = DiffuseSurface()
HOLE = DiffuseSurface(cover=ZERO)
