"""Limits of 16-bit floats."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Half:
    """Range of a half float (IEEE 754 binary16); half OpenEXR files store light without an encoding."""

    @property
    def largest(self) -> float:
        """Largest finite value."""
        return 65504.0

    @property
    def smallest(self) -> float:
        """Half of the smallest subnormal value."""
        return 2.0**-25
