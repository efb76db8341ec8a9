"""What was asked of a bake, as images: all light, its parts, ambient occlusion, shadow masks."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from .finish.store import LightmapStore
from .sampled import SampledLight
from .settings import Settings
from .solve import Jacobi

#: Outputs that hold light, and those of them that need more than the first iteration.
_LIGHT = ("combined", "direct", "indirect")
_BOUNCES = ("combined", "indirect")


class Outputs:
    """Makes the outputs that the settings name."""

    def __init__(self, settings: Settings, sampled: SampledLight, store: LightmapStore) -> None:
        self._names, self._sampled, self._store = settings.outputs, sampled, store
        self.bounces = any(name in _BOUNCES for name in self._names)

    def done(self, solution: Jacobi) -> bool:
        """True once a solution is good enough for the outputs.

        One iteration is needed by all of them: it tells which patches are hidden inside objects.
        """
        return solution.done if self.bounces else solution.iterations > 0

    def main(self, solution: Jacobi) -> np.ndarray:
        """Return the light that the main image holds, (n, 3) float32: of the first output that is light."""
        return _light(next((name for name in self._names if name in _LIGHT), "direct"), solution)

    def partial(self, solution: Jacobi) -> np.ndarray:
        """Return the main image so far, (atlases, r, r, 3) float32, for display."""
        return self._store.display(self.main(solution))

    def passes(self, solution: Jacobi) -> Generator[float, None, dict[str, np.ndarray]]:
        """Make every output, (atlases, r, r, 3) float32 for display, by name; yield the fraction done."""
        passes: dict[str, np.ndarray] = {}
        for name in self._names:
            if name in _LIGHT:
                passes[name] = self._store.display(_light(name, solution))
            elif name == "ambient_occlusion":
                passes[name] = self._store.display((yield from self._sampled.ambient_occlusion()))
            else:
                for index, light in enumerate(self._sampled.lights):
                    mask = yield from self._sampled.shadow_mask(index)
                    passes[_unused(f"{name} {light.name}", passes)] = self._store.display(mask)
        return passes


def _light(name: str, solution: Jacobi) -> np.ndarray:
    """Return E/pi of all light, or of a part of it, (n, 3) float32."""
    parts = {"combined": solution.irradiance, "direct": solution.direct, "indirect": solution.indirect}
    return parts[name]


def _unused(name: str, taken: dict[str, np.ndarray]) -> str:
    """Return a name, with a number if it is taken: instances of a light share its name."""
    if name not in taken:
        return name
    return next(other for number in range(2, len(taken) + 3) if (other := f"{name} {number}") not in taken)
