"""Stages of a run: unwrapping and reading, the bake, and saving, with one progress for all of them."""

from __future__ import annotations

from ..engine.plan.estimate import estimate
from ..engine.plan.stages import Extent
from ..engine.progress import Schedule, Stage
from ..engine.scene.model import Scene
from ..engine.settings import Settings

#: Estimated seconds, before any was measured: for unwrapping, for reading a scene, for unwrapping a face, and
#: for writing a texel of an image.
_UNWRAPPING, _READING, _FACE, _TEXEL = 1.0, 1.0, 4e-4, 2e-7

#: Estimated fraction of a lightmap's texels that are patches.
_COVERAGE = 0.6


class RunStages(Schedule):
    """Schedule of a run: unwrapping and reading the scene, the bake with its own stages, saving.

    paces:  seconds per unit of each stage in earlier runs, by its name; updated by this run
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
        """Set estimated amounts before the scene is read: its extent, and the number of faces to unwrap."""
        self.unwrapping.pace = _UNWRAPPING + _FACE * faces
        self._expect_bake(extent, settings)

    def expect(self, scene: Scene, settings: Settings, images: int) -> None:
        """Set the amounts of the bake, and the number of images to save."""
        self._expect_bake(Extent.of(scene), settings)
        self.saving.amount = images * settings.resolution**2

    def _expect_bake(self, extent: Extent, settings: Settings) -> None:
        patches = round(_COVERAGE * settings.resolution**2 * extent.atlases)
        self.baking.pace = estimate(extent, patches, settings, self._paces).seconds

    def has_saved(self) -> None:
        """End saving, and store its seconds per texel for the next run."""
        self.end()
        self._paces["Saving"] = self.saving.seconds / self.saving.amount
