"""Quantities of a material: constants, textures, and what can be computed with them exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....engine.scene.texture import Texture
from .sockets import ComplexError


@dataclass(frozen=True)
class Value:
    """A constant, (3,) float64, times a texture where there is one."""

    constant: np.ndarray
    texture: Texture | None = None

    def __mul__(self, other: Value | float) -> Value:
        """Multiply; raises ComplexError for two textures."""
        if not isinstance(other, Value):
            return Value(self.constant * other, self.texture)
        if self.texture is not None and other.texture is not None:
            raise ComplexError
        return Value(self.constant * other.constant, self.texture or other.texture)

    def __add__(self, other: Value) -> Value:
        """Add; raises ComplexError if a texture takes part and nothing is zero."""
        if self.is_zero:
            return other
        if other.is_zero:
            return self
        if self.texture is not None or other.texture is not None:
            raise ComplexError
        return Value(self.constant + other.constant)

    @property
    def is_zero(self) -> bool:
        """True for nothing."""
        return not self.constant.any()

    @property
    def number(self) -> float:
        """The value of a constant grey; raises ComplexError for a texture."""
        if self.texture is not None:
            raise ComplexError
        return float(self.constant[0])


def constant(*values: float) -> Value:
    """Return a constant of one or three channels."""
    return Value(np.broadcast_to(np.array(values, np.float64), (3,)).copy())


@dataclass(frozen=True)
class Surface:
    """What a shader does with light.

    reflectance, emission  of the part that is there
    alpha                  the fraction of it that is there; grey
    threshold              see engine.Material
    """

    reflectance: Value
    emission: Value
    alpha: Value
    threshold: float | None = None

    @property
    def is_hole(self) -> bool:
        """True if nothing is there."""
        return self.alpha.is_zero


ZERO, ONE = constant(0.0), constant(1.0)
BLACK = Surface(ZERO, ZERO, ONE)
HOLE = Surface(ZERO, ZERO, ZERO)
