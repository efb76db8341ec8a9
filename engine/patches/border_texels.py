"""Border texels, which triangles touch without covering the centre."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.device_rows import Rows, host_rows

#: Offsets (dy, dx) of the neighbours whose patch a border texel may take, nearest first.
OFFSETS = sorted(
    ((dy, dx) for dy in range(-2, 3) for dx in range(-2, 3) if (dy, dx) != (0, 0)),
    key=lambda offset: (offset[0] ** 2 + offset[1] ** 2, offset),
)


@dataclass(frozen=True)
class BorderTexels:
    """Border texels, whose centre no triangle covers, and the touching triangle nearest to it.

    texel_rows:     (m,) integers on host or device, ascending: (atlas * resolution + row) * resolution +
                    column
    triangle_rows:  (m,) int32 on host or device
    """

    texel_rows: Rows
    triangle_rows: Rows

    def __len__(self) -> int:
        return len(self.texel_rows)

    @property
    def texel(self) -> np.ndarray:
        """Texel on the host, (m,)."""
        return host_rows(self.texel_rows)

    @property
    def triangle(self) -> np.ndarray:
        """Triangle on the host, (m,) int32."""
        return host_rows(self.triangle_rows)

    def subset(self, chosen: np.ndarray) -> BorderTexels:
        """Return a subset of the texels, by a mask or by indices."""
        return BorderTexels(self.texel[chosen], self.triangle[chosen])
