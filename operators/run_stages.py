"""What a run does around the engine's bake, and the one percentage over all of it."""

from __future__ import annotations

from ..engine.plan.estimate import estimate
from ..engine.plan.stages import Extent
from ..engine.progress import Schedule, Stage
from ..engine.scene.model import Scene
from ..engine.settings import Settings

#: Seconds that unwrapping and reading a scene take, unwrapping a face, and writing a texel of an image,
#: before any was measured.
_UNWRAPPING, _READING, _FACE, _TEXEL = 1.0, 1.0, 4e-4, 2e-7

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
        names = ("Light before", "Lamps before", "Light now")
        self.before, self.lamps, self.now = (Stage(name) for name in names)
        self.baking = Stage("Starting")
        self.saving = Stage("Saving", 0, paces.get("Saving", _TEXEL), "Saving" in paces)
        super().__init__(
            [self.unwrapping, self.reading, self.before, self.lamps, self.now, self.baking, self.saving]
        )

    def foresee(self, extent: Extent, faces: int, settings: Settings) -> None:
        """Learn before the scene is read how large it is about, and how many faces are to be unwrapped."""
        self.unwrapping.pace = _UNWRAPPING + _FACE * faces
        self._expect_bake(extent, settings)

    def expect(self, scene: Scene, settings: Settings, images: int) -> None:
        """Learn how much is to be baked, and how many images are to be saved."""
        self._expect_bake(Extent.of(scene), settings)
        self.saving.amount = images * settings.resolution**2

    def _expect_bake(self, extent: Extent, settings: Settings) -> None:
        patches = round(_COVERAGE * settings.resolution**2 * extent.atlases)
        self.baking.pace = estimate(extent, patches, settings, self._paces).seconds

    def has_saved(self) -> None:
        """End saving, and keep its pace for the next run."""
        self.end()
        self._paces["Saving"] = self.saving.seconds / self.saving.amount
