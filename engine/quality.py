"""Qualities of a bake: how far its light may be from the exact one, and the settings that it takes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple


class Quality(NamedTuple):
    """What a person chooses in place of numbers of samples.

    label     name in the interface
    error     largest RMSE of a lightmap in the rooms of tools/quality.py, fraction of the map's mean
    values    the settings that it stands for, by name
    denoised  the error with Denoise, of the quality that it is meant for; None of others
    """

    label: str
    error: float
    values: dict[str, int]
    denoised: float | None = None

    @property
    def text(self) -> str:
        """What it is, without a full stop."""
        denoised = f", with Denoise by {self.denoised:.1%}" if self.denoised else ""
        rays = self.values["samples"] or 2 * self.values["hemicube"] ** 2
        return (
            f"The light of a texel is off by {self.error:.1%} of the mean or less{denoised} (RMSE, in rooms "
            f"that were measured): {rays:,} rays a patch, {self.values['light_samples']} more to each light"
        )


def _quality(
    label: str,
    error: float,
    hemicube: int,
    samples: int,
    light_samples: int,
    adaptive: bool,
    denoised: float | None = None,
) -> Quality:
    values = {
        "hemicube": hemicube, "samples": samples, "light_samples": light_samples, "adaptive": adaptive
    }  # fmt: skip
    return Quality(label, error, values, denoised)


#: By name, the fastest first; `high` is what the engine does by itself. Errors measured by tools/quality.py.
QUALITIES = {
    "draft": _quality("Draft", 0.08, 8, 64, 32, adaptive=False, denoised=0.04),
    "preview": _quality("Preview", 0.03, 16, 256, 32, adaptive=True),
    "high": _quality("High", 0.007, 32, 0, 64, adaptive=False),
    "very_high": _quality("Very High", 0.003, 64, 0, 256, adaptive=False),
}

#: The settings that a quality stands for.
QUALITY_SETTINGS = tuple(QUALITIES["high"].values)


def quality_of(values: Mapping[str, Any]) -> str | None:
    """Return the quality that has these settings, by name; None if there is none."""
    chosen = {name: values[name] for name in QUALITY_SETTINGS}
    return next((name for name, quality in QUALITIES.items() if quality.values == chosen), None)
