"""What a run does around the engine's bake, and the one percentage over all of it."""

from __future__ import annotations

from ..engine.progress import Schedule, Stage

#: Seconds that unwrapping, reading a scene, a bake, and writing a texel of an image take before any was
#: measured.
_UNWRAPPING, _READING, _BAKING, _TEXEL = 1.0, 1.0, 10.0, 2e-7


class RunStages(Schedule):
    """Unwrapping and reading the scene, the bake with stages of its own, saving what it made.

    paces  seconds that a unit of each stage took in earlier runs, by its name; this one adds to them
    """

    def __init__(self, paces: dict[str, float]) -> None:
        self._paces = paces
        self.unwrapping = Stage("Unwrapping", pace=_UNWRAPPING)
        self.reading = Stage("Reading the scene", pace=_READING)
        self.baking = Stage("Baking", pace=_BAKING)
        self.saving = Stage("Saving", 0, paces.get("Saving", _TEXEL), "Saving" in paces)
        super().__init__([self.unwrapping, self.reading, self.baking, self.saving])

    def expect_texels(self, texels: int) -> None:
        """Learn how many texels all images have together."""
        self.saving.amount = texels

    def has_saved(self) -> None:
        """End saving, and keep its pace for the next run."""
        self.end()
        self._paces["Saving"] = self.saving.seconds / self.saving.amount
