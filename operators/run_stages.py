"""Stages of a run: unwrapping and reading, the bake, and saving, with one progress for all of them."""

from __future__ import annotations

import time

from ..engine.plan.estimate import estimate
from ..engine.plan.stages import COVERAGE, Extent
from ..engine.progress import Schedule, Stage
from ..engine.scene.model import Scene
from ..engine.settings import Settings

#: Estimated seconds of unwrapping: with nothing to unwrap, to start the process, and for each face. Measured
#: on 2 cores: 0.5 s for a room, 4.9 and 6.5 CPU s for levels of 79,000 and 229,000 faces.
_NOTHING, _UNWRAPPING, _FACE = 0.05, 0.5, 5e-5

#: Estimated seconds of reading a scene and each of its triangles (2 s for 316,000), and of writing a texel.
_READING, _TRIANGLE, _TEXEL = 0.1, 5e-6, 2e-7


class RunStages(Schedule):
    """Schedule of a run: unwrapping and reading the scene, the bake with its own stages, saving.

    paces:      seconds per unit of each stage in earlier runs, by its name; updated by this run
    preparing:  expected seconds from now until the kernels of the device are built
    """

    def __init__(self, paces: dict[str, float], preparing: float = 0.0) -> None:
        self._paces, self._unwrapping_guess = paces, 0.0
        self._prepared = time.perf_counter() + preparing
        self.unwrapping = Stage("Unwrapping", pace=_UNWRAPPING)
        self.reading = Stage("Reading the scene", pace=_READING)
        names = ("Light before", "Lamps before", "Light now")
        self.before, self.lamps, self.now = (Stage(name) for name in names)
        self.baking = Stage("Starting")
        self.saving = Stage("Saving", 0, paces.get("Saving", _TEXEL), "Saving" in paces)
        super().__init__(
            [self.unwrapping, self.reading, self.before, self.lamps, self.now, self.baking, self.saving]
        )

    def foresee(self, extent: Extent, faces: int, settings: Settings) -> None:
        """Set estimated amounts before the scene is read: its extent, and the number of faces to unwrap."""
        self._unwrapping_guess = _UNWRAPPING + _FACE * faces if faces else 0.0
        self.unwrapping.pace = self._unwrapping_guess * self._paces.get("Unwrapping", 1.0) or _NOTHING
        self.reading.pace = _READING + _TRIANGLE * extent.triangles
        self._expect_bake(extent, settings)

    def expect(self, scene: Scene, settings: Settings, images: int) -> None:
        """Set the amounts of the bake, and the number of images to save."""
        self._expect_bake(Extent.of(scene), settings)
        self.saving.amount = images * settings.resolution**2

    def _expect_bake(self, extent: Extent, settings: Settings) -> None:
        patches = round(COVERAGE * settings.resolution**2 * extent.atlases)
        preparing = max(0.0, self._prepared - time.perf_counter())
        self.baking.pace = estimate(extent, patches, settings, self._paces, preparing).seconds

    def has_saved(self) -> None:
        """End saving; store its seconds per texel, and how wrong unwrapping was guessed, for the next run."""
        self.end()
        self._paces["Saving"] = self.saving.seconds / self.saving.amount
        if self._unwrapping_guess and self.unwrapping.seconds > 0:
            self._paces["Unwrapping"] = self.unwrapping.seconds / self._unwrapping_guess
