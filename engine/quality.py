"""Quality presets: numbers of samples with a known error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple


class Quality(NamedTuple):
    """Preset that replaces numbers of samples.

    label:     name in the interface
    error:     maximum RMSE of a lightmap in the test rooms of tools/quality.py, as a fraction of the mean
    values:    settings of the preset, by name
    denoised:  the error with Denoise if the preset is meant for it, else None
    """

    label: str
    error: float
    values: dict[str, int]
    denoised: float | None = None

    @property
    def text(self) -> str:
        """Description for the interface, without a full stop."""
        denoised = f" ({self.denoised:.1%} with Denoise)" if self.denoised else ""
        rays = self.values["samples"] or 2 * self.values["hemicube"] ** 2
        return (
            f"Error below {self.error:.1%} of the mean{denoised}, {rays:,} samples per texel, "
            f"{self.values['light_samples']} per light"
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


#: Presets by name, fastest first; `high` equals the defaults. Errors measured by tools/quality.py.
QUALITIES = {
    "draft": _quality("Draft", 0.1, 8, 64, 32, adaptive=False, denoised=0.04),
    "preview": _quality("Preview", 0.03, 16, 256, 32, adaptive=True),
    "high": _quality("High", 0.011, 32, 0, 64, adaptive=False),
    "very_high": _quality("Very High", 0.006, 64, 0, 256, adaptive=False),
}

#: Names of the settings that a preset sets.
QUALITY_SETTINGS = tuple(QUALITIES["high"].values)


def quality_of(values: Mapping[str, Any]) -> str | None:
    """Return the name of the preset whose values equal these settings; None if there is none."""
    chosen = {name: values[name] for name in QUALITY_SETTINGS}
    return next((name for name, quality in QUALITIES.items() if quality.values == chosen), None)
