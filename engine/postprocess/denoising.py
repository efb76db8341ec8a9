"""Denoising of lightmaps with Open Image Denoise (OIDN), before the seam fit and the gutter fill.

OIDN is trained on pictures, where surfaces border on each other. Each chart is therefore divided by its
brightness level and grown by one texel, and the gutters are filled smoothly. This leaves no edges between
charts that the filter would preserve together with their noise. A change far above the noise level is detail
and is rejected. Large lightmaps are filtered in overlapping windows, which bounds the memory.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator
from itertools import pairwise, product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..denoise.found import REMEDY, library_of_packages
from ..denoise.library import DenoiseDevice, DenoiseLibrary
from ..errors import DenoiseError
from ..scene.color import luminance
from ..settings import Settings
from .dilation import Dilation, grown
from .independent_estimate import IndependentEstimate, denoise_weight
from .membrane_fill import MembraneFill
from .texel_charts import TexelCharts

#: Margin in texels that a window reads but does not write: the receptive field of the filter.
_MARGIN = 128

#: Maximum width of a window with its margins, texels.
_WINDOW = 2048

#: Mean luminance that the filter expects: middle grey.
_GREY = 0.18

#: Minimum number of texels of a chart in which the filter separates noise from detail reliably.
_LARGE = 400

#: Limits for changes by the denoiser, in standard deviations of the noise. Smaller changes than the first are
#: accepted, larger ones than the second are rejected.
_NOISE, _DETAIL = 5.0, 10.0

#: Ratio of the standard deviation of normal noise to the median of its absolute value.
_OF_MEDIAN = 1.48


class Denoising:
    """Denoiser of lightmaps.

    known:     (atlases, r, r) bool, texels with valid light; no other texel is read or changed
    settings:  settings of the bake
    warnings:  messages for the user
    reasons:   sentences for the report
    """

    def __init__(self, known: np.ndarray, settings: Settings) -> None:
        self._known, self._settings = known, settings
        self.warnings: list[str] = []
        self.reasons: list[str] = []

    def run(
        self, images: dict[str, np.ndarray], independent: IndependentEstimate | None = None
    ) -> Generator[float, None, dict[str, np.ndarray]]:
        """Denoise images, (atlases, r, r, 3) float32, by name; yield the fraction done.

        If the library is missing or fails, adds a warning and returns the images unchanged.

        independent:  independent estimate that weights the changes; without one, the weight comes from the
                      noise level
        """
        try:
            device = self._device()
            try:
                filtered = yield from self._filtered(device, images, independent)
            finally:
                device.release()
            self.reasons.append(f"{device.name} denoised the lightmaps.")
            return filtered
        except DenoiseError as error:
            self.warnings.append(f"The lightmaps were not denoised. {error}")
            return images

    def _device(self) -> DenoiseDevice:
        """Return the chosen OIDN device, or the CPU with a warning if that device fails."""
        library = DenoiseLibrary(_library(self._settings))
        chosen = self._settings.denoise_device
        if chosen != "cpu":
            try:
                return DenoiseDevice(library, chosen)
            except DenoiseError as error:
                self.warnings.append(
                    f"{error} The CPU denoised instead: choose another Denoise Device in Hemibake's "
                    "preferences, or update the driver."
                )
        return DenoiseDevice(library, "cpu")

    def _filtered(
        self, device: DenoiseDevice, images: dict[str, np.ndarray], independent: IndependentEstimate | None
    ) -> Generator[float, None, dict[str, np.ndarray]]:
        """Filter each window of each image; images that are completely black are returned unchanged."""
        windows = [window for window in _windows(self._known.shape) if self._known[window.core].any()]
        lit = {name: image for name, image in images.items() if image[self._known].any()}
        if not lit:
            return images
        charts = TexelCharts(self._known)
        levels = {name: charts.levels(image) for name, image in lit.items()}
        parts = {name: self._product(image, 1 / levels[name]) for name, image in lit.items()}
        scales = {name: _scale(image[self._known]) for name, image in parts.items()}
        filtered = {name: image.copy() for name, image in parts.items()}
        for number, window in enumerate(windows):
            known = self._known[window.core]
            gutters = _Gutters(self._known[window.whole])
            for name, image in parts.items():
                yield number / len(windows)
                noisy = image[window.whole] * scales[name]
                gutters.fill(noisy)
                quiet = device.filtered(noisy) / scales[name]
                filtered[name][window.core][known] = quiet[window.inner][known]
        filtered = {name: self._product(image, levels[name]) for name, image in filtered.items()}
        noise = self._part_of_noise(lit, filtered, charts, independent)[:, None]
        for name, image in lit.items():
            filtered[name][self._known] = self._without_noise(name, image, filtered[name], noise, independent)
        return images | filtered

    def _without_noise(
        self,
        name: str,
        image: np.ndarray,
        filtered: np.ndarray,
        noise: np.ndarray,
        independent: IndependentEstimate | None,
    ) -> np.ndarray:
        """Return light of known texels, (k, 3) float32, with the noise part of the change removed.

        noise:  (k, 1) float32, fraction of each change that is noise, shared by all images
        """
        before, after = image[self._known], filtered[self._known]
        light = before + noise * (after - before)
        if independent is not None and name in independent.images:
            # Where the filter's change is rejected, average the light with an independent estimate, since
            # twice the samples have less noise.
            there = independent.centres[self._known, None]
            light += independent.part * (1 - noise) * there * (independent.images[name][self._known] - before)
        return light

    def _part_of_noise(
        self,
        images: dict[str, np.ndarray],
        filtered: dict[str, np.ndarray],
        charts: TexelCharts,
        independent: IndependentEstimate | None,
    ) -> np.ndarray:
        """Return the fraction of each known texel's change that is noise, (k,) float32 in [0, 1]."""
        name = (
            next((name for name in independent.images if name in images), None)
            if independent is not None
            else None
        )
        if independent is None or name is None:
            noisy, quiet = (
                luminance(sum(image[self._known] for image in maps.values())) for maps in (images, filtered)
            )
            return noise_fraction(noisy, quiet, charts)
        light, there = images[name][self._known], independent.centres[self._known, None]
        seen = np.where(there, independent.images[name][self._known], light)
        return denoise_weight(light, filtered[name][self._known], seen, charts)

    def _product(self, image: np.ndarray, factors: np.ndarray) -> np.ndarray:
        """Return a copy of the image whose known texels are multiplied by factors, (k, 3)."""
        product = image.copy()
        product[self._known] *= factors
        return product


class _Gutters:
    """Fill of the gutters between charts before filtering: one dilated ring, then a membrane.

    known:  (h, w) bool, texels of charts
    """

    def __init__(self, known: np.ndarray) -> None:
        extended = grown(known)
        self._fills = Dilation(known, 1), MembraneFill(extended, np.ones_like(extended))

    def fill(self, image: np.ndarray) -> None:
        """Fill the gutters of a contiguous (h, w, 3) float32 image in place."""
        for fill in self._fills:
            fill.fill(image)


class _Window(NamedTuple):
    """Window: part of one lightmap that is filtered in one call.

    whole:  atlas, rows and columns that the filter reads
    core:   atlas, rows and columns that it writes; the cores of all windows tile the lightmaps
    inner:  rows and columns of the core relative to the window
    """

    whole: tuple[int, slice, slice]
    core: tuple[int, slice, slice]
    inner: tuple[slice, slice]


def _windows(shape: tuple[int, ...]) -> Iterator[_Window]:
    """Yield windows of equal size that cover square lightmaps of shape (atlases, r, r)."""
    atlases, resolution, _ = shape
    for atlas, rows, columns in product(range(atlases), _spans(resolution), _spans(resolution)):
        whole, core = (atlas, rows[0], columns[0]), (atlas, rows[1], columns[1])
        inner = tuple(slice(c.start - w.start, c.stop - w.start) for w, c in (rows, columns))
        yield _Window(whole, core, (inner[0], inner[1]))


def _spans(size: int) -> list[tuple[slice, slice]]:
    """Return, for each window along one axis, the slice that it reads and the slice that it writes."""
    width = min(size, _WINDOW)
    count = 1 if size <= width else math.ceil((size - 2 * _MARGIN) / (width - 2 * _MARGIN))
    starts = [min(number * (width - 2 * _MARGIN), size - width) for number in range(count)]
    ends = [0, *(start + _MARGIN for start in starts[1:]), size]
    return [
        (slice(start, start + width), slice(*core))
        for start, core in zip(starts, pairwise(ends), strict=True)
    ]


def _scale(texels: np.ndarray) -> np.float32:
    """Return the exposure that maps the geometric mean luminance of light, (n, 3), to middle grey.

    OIDN would choose the same exposure, but separately for each window.
    """
    light = luminance(texels)
    lit = light[light > 0].astype(np.float64)
    return np.float32(_GREY / np.exp(np.log(lit).mean())) if len(lit) else np.float32(1)


def _library(settings: Settings) -> Path:
    """Return the path of the OIDN library; raise DenoiseError if there is none."""
    path = Path(settings.denoise_library) if settings.denoise_library else library_of_packages()
    if path is None:
        raise DenoiseError(f"There is no Open Image Denoise. {REMEDY}.")
    return path


def noise_fraction(noisy: np.ndarray, quiet: np.ndarray, charts: TexelCharts) -> np.ndarray:
    """Return the fraction of each texel's change that counts as noise, (k,) float32 in [0, 1].

    Noise is assumed proportional to the light. Its standard deviation follows from the median relative change
    in large charts, or in all charts if none is large. In large charts all of the change is noise, even
    outliers, which few rays produce. In small charts a change far above the standard deviation is detail. For
    the remaining changes of a small chart, James-Stein shrinkage ("Estimation with Quadratic Loss", 1961)
    gives one common fraction from their sum of squares.

    noisy, quiet:  (k,) float32, luminance before and after the filter
    charts:        chart of each texel
    """
    change = np.divide(np.abs(quiet - noisy), quiet, out=np.zeros_like(quiet), where=quiet > 0)
    large = (charts.size >= _LARGE)[charts.number]
    changes = change[large] if large.any() else change
    noise = _OF_MEDIAN * float(np.median(changes)) if len(changes) else 0.0
    times = change / noise if noise > 0 else np.zeros_like(change)
    part: np.ndarray = np.clip((_DETAIL - times) / (_DETAIL - _NOISE), 0, 1).astype(np.float32)
    part *= _explained(part * times, part > 0, charts)[charts.number]
    part[large] = 1
    return part


def _explained(times: np.ndarray, counts: np.ndarray, charts: TexelCharts) -> np.ndarray:
    """Return the fraction of each chart's changes that noise explains, (c,) in [0, 1].

    times:   (k,) float32, changes in standard deviations of the noise
    counts:  (k,) bool, texels whose change counts
    charts:  chart of each texel
    """
    squares, number = (np.bincount(charts.number, values, len(charts.size)) for values in (times**2, counts))
    explained: np.ndarray = np.minimum(number / np.maximum(squares, 1e-30), 1)
    return np.where(number > 0, explained, 1)
