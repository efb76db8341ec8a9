"""Protocol of hemicube integration by OpenGL or OpenCL."""

from __future__ import annotations

from typing import Protocol

import numpy as np


class Integrator(Protocol):
    """Integrator of the radiance hemicubes in a texture array; `name` is "glsl" or "opencl"."""

    name: str

    def integrate(self, frames: np.ndarray) -> np.ndarray:
        """Return E/pi and the fraction of front faces for the first m slots, (m, 4) float32.

        rgb is E/pi, the multiplier-weighted mean radiance above the horizon; a is the weighted mean of the
        front flag. frames: (m, 4, 3) float32, the rows of `Viewpoints.frame` and the horizon.
        """
