"""What a run does around the engine's bake, and the one percentage over all of it."""

from __future__ import annotations

from ..engine.plan.estimate import estimate
from ..engine.plan.stages import Extent
from ..engine.progress import Schedule, Stage
from ..engine.scene.model import Scene
from ..engine.settings import Settings

#: Seconds that unwrapping, reading a scene, a bake, and writing a texel of an image take before any was
#: measured.
_UNWRAPPING, _READING, _BAKING, _TEXEL = 1.0, 1.0, 10.0, 2e-7


#: Fraction of a lightmap's texels that are patches.
_COVERAGE = 0.6


class RunStages(Schedule):
    """Unwrapping and reading the scene, the bake with stages of its own, saving what it made.

    paces  seconds that a unit of each stage took in earlier runs, by its name; this one adds to them
    """

    def __init__(self, paces: dict[str, float]) -> None:
        self._paces = paces
        self.unwrapping = Stage("Unwrapping", pace=_UNWRAPPING)
        self.reading = Stage("Reading the scene", pace=_READING)
        self.baking = Stage("Starting", pace=_BAKING)
        self.saving = Stage("Saving", 0, paces.get("Saving", _TEXEL), "Saving" in paces)
        super().__init__([self.unwrapping, self.reading, self.baking, self.saving])

    def expect(self, scene: Scene, settings: Settings, images: int) -> None:
        """Learn how much is to be baked, and how many images are to be saved."""
        texels = settings.resolution**2
        patches = round(_COVERAGE * texels * len(scene.atlases))
        self.baking.pace = estimate(Extent.of(scene), patches, settings, self._paces).seconds
        self.saving.amount = images * texels

    def has_saved(self) -> None:
        """End saving, and keep its pace for the next run."""
        self.end()
        self._paces["Saving"] = self.saving.seconds / self.saving.amount
