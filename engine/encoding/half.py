"""Limits of 16-bit floats."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Half:
    """Range of a half float (IEEE 754 binary16); half OpenEXR files store light without an encoding."""

    @property
    def largest(self) -> float:
        """Largest value that a half float can store."""
        return 65504.0

    @property
    def smallest(self) -> float:
        """Smallest value that is not rounded to 0: half of the smallest subnormal."""
        return 2.0**-25
