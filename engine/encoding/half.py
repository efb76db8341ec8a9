"""The limits of 16-bit floats."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Half:
    """What a channel of 16 bits holds (IEEE 754 binary16); OpenEXR files of them hold light as it is."""

    @property
    def largest(self) -> float:
        """The largest finite value."""
        return 65504.0

    @property
    def smallest(self) -> float:
        """Half of the least subnormal value."""
        return 2.0**-25
