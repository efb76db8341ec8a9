"""What was asked of a bake: all light, its parts, ambient occlusion, shadow masks."""

from __future__ import annotations

from collections.abc import Generator
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ..errors import SceneError
from ..scene.model import Scene, shining_lights
from ..settings import Settings
from ..solve.solver import Solution

if TYPE_CHECKING:
    from ..direct.lighting import DirectLighting


def output_names(scene: Scene, settings: Settings) -> list[str]:
    """Return the names of `Lightmap.passes`, in their order; instances of a light get numbers.

    Raises SceneError if there is nothing to give.
    """
    names: list[str] = []
    for name in settings.outputs:
        if name == "shadow_mask":
            names += [f"{name} {light.name}" for light in shining_lights(scene)]
        else:
            names.append(name)
    if not names:
        raise SceneError(
            "Shadow masks need a light, and the scene has none. Add one, or choose other outputs."
        )
    taken: set[str] = set()
    for index, name in enumerate(names):
        names[index] = _unused(name, taken)
        taken.add(names[index])
    return names


class Light(Protocol):
    """What points receive: E/pi of all light and of its parts, (n, 3) float32."""

    @property
    def irradiance(self) -> np.ndarray:
        """Of all light."""
        ...

    @property
    def direct(self) -> np.ndarray:
        """Of light that was not reflected."""
        ...

    @property
    def indirect(self) -> np.ndarray:
        """Of light that was."""
        ...


class Outputs:
    """Makes the outputs that the settings name."""

    def __init__(self, scene: Scene, settings: Settings, lighting: DirectLighting) -> None:
        self._names, self._settings, self._lighting = output_names(scene, settings), settings, lighting

    @property
    def begin_with_direct(self) -> bool:
        """True if intermediate lightmaps are shown, and direct light is the first of what they show."""
        first = self._settings.light_outputs[:1]
        return self._settings.intermediates and first in (("combined",), ("direct",))

    def done(self, solution: Solution) -> bool:
        """True once a solution is good enough for the outputs.

        One iteration is needed by all that are lit: it tells which patches are hidden inside objects.
        """
        return solution.done or (solution.iterations > 0 and not self._settings.bounces)

    def light(self, solution: Solution) -> np.ndarray:
        """Return the first output that is light, so far, (n, 3) float32; direct light if none is."""
        first, *_ = (*self._settings.light_outputs, "direct")
        return _light(first, solution)

    def make(self, solution: Light) -> Generator[float, None, dict[str, np.ndarray]]:
        """Make every output, (n, 3) or (n,) float32, by name; yield the fraction done of each."""
        made: dict[str, np.ndarray] = {}
        masks = iter(range(len(self._names)))
        for name in self._names:
            if name in self._settings.light_outputs:
                made[name] = _light(name, solution)
            elif name == "ambient_occlusion":
                made[name] = yield from self._lighting.ambient_occlusion()
            else:
                made[name] = yield from self._lighting.shadow_mask(next(masks))
        return made


def _light(name: str, solution: Light) -> np.ndarray:
    """Return E/pi of all light, or of a part of it, (n, 3) float32."""
    if name == "combined":
        return solution.irradiance
    return solution.direct if name == "direct" else solution.indirect


def _unused(name: str, taken: set[str]) -> str:
    """Return a name, with a number if it is taken."""
    if name not in taken:
        return name
    return next(other for number in range(2, len(taken) + 3) if (other := f"{name} {number}") not in taken)
