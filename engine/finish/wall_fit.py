"""Texels beside walls that are too thin for them, fitted to what their bilinear display shows on both sides.

Such a texel is interpolated on a lit side and on a dark one. The mean of both leaks: the eye sees contrast
(Weber's law), so the dark side shows a bright line, many times as bright as what is there. Least squares of
the relative error put the step of light on the lit side, where it is like a shadow at the foot of the wall.
"""

from __future__ import annotations

import numpy as np

from ..device.buffers import upload_float4
from ..device.compute import Compute
from ..patches.seams import no_seams
from .device_equations import DeviceEquations
from .device_fit import DeviceFit
from .display_samples import DisplaySamples
from .lightmap_points import LightmapPoints, centre_points, joined_points

#: Light below this part of the brightest around counts as if it were that bright.
_FAINT = 1 / 20

#: Texels are fitted up to this many texels from the samples in a wall.
_REACH = 1

#: Light within this many texels is around a texel.
_AROUND = 2

#: Weight of texels that are not fitted: they stay as they are.
_FIXED = 100.0


class WallFit:
    """What texels within one of a thin wall show: the least squares of the relative error of their display.

    samples  of all texels
    visible  (s,) bool, samples that somebody sees
    light    (s,) float32, E/pi of the samples, sum of the channels
    inside   (k,) int64, samples in thin walls
    shown    (atlases, r, r, 1) float32, that light as all texels show it without walls
    known    (atlases, r, r) bool, texels that show what is seen of them

    texels   (t,) int64, flat indices of those that are fitted
    centres  (p,) int64, flat indices of those of whose centres the light counts
    """

    def __init__(
        self,
        compute: Compute,
        samples: DisplaySamples,
        visible: np.ndarray,
        light: np.ndarray,
        inside: np.ndarray,
        shown: np.ndarray,
        known: np.ndarray,
    ) -> None:
        resolution = known.shape[1]
        keys, flat = samples.keys(resolution), known.ravel()
        near = _around(keys[inside], resolution, _REACH)
        self.texels = near[flat[near]]
        around = _around(self.texels, resolution, 1)

        # Samples tell what is shown beside the wall; so do centres of texels without any, and what stays.
        told = np.zeros(known.size, bool)
        told[around] = True
        self._samples = np.flatnonzero(visible & (samples.weight > 0) & told[keys])
        beside, stays = np.zeros(known.size, bool), np.zeros(known.size, bool)
        beside[self.texels] = True
        farther = _around(around, resolution, 1)
        stays[farther[flat[farther] & ~beside[farther]]] = True
        beside[keys[self._samples]] = False
        self.centres = np.flatnonzero(stays | beside)

        # The square of the relative error, of what is around.
        bright = _brightest_around(shown[..., 0], known, keys[self._samples])
        relative = _relative_weight(light[self._samples], bright)
        chosen = LightmapPoints(
            samples.atlas[self._samples], samples.position[self._samples],
            samples.weight[self._samples] * relative,
        )  # fmt: skip
        bright = _brightest_around(shown[..., 0], known, self.centres)
        weight = _relative_weight(shown.ravel()[self.centres], bright)
        weight[stays[self.centres]] *= _FIXED
        centres = centre_points(self.centres, resolution)
        points = joined_points(chosen, LightmapPoints(centres.atlas, centres.position, weight))
        self._order = np.argsort(points.texels(resolution), kind="stable")
        nowhere = np.zeros(known.shape, bool)
        equations = DeviceEquations(compute, nowhere, points.part(self._order), no_seams())
        self._compute, self._fit = compute, DeviceFit(compute, equations, tight=True)
        self._unknown = np.searchsorted(equations.texel, self.texels)

    def light(self, samples: np.ndarray, at_centres: np.ndarray) -> np.ndarray:
        """Return the light of the `texels` beside walls, (t, c) float32.

        samples     (s, 3) or (s,) float32, of all samples
        at_centres  (p, c) float32, of the texels `centres`, what these show without walls
        """
        values = samples.reshape(len(samples), -1)[self._samples]
        colors = [np.broadcast_to(some, (len(some), 3)) for some in (values, at_centres)]
        points = np.concatenate(colors)[self._order]
        largest = float(np.abs(points).max(initial=0))
        light: np.ndarray = self._fit.unknowns(upload_float4(self._compute, points), largest)
        return light[self._unknown, : at_centres.shape[1]]


def _relative_weight(light: np.ndarray, bright: np.ndarray) -> np.ndarray:
    """Return the weight of the squared error of light, (n,), that makes it relative; 1 for what is bright."""
    weight: np.ndarray = (bright / np.maximum(light, _FAINT * np.maximum(bright, 1e-30))) ** 2
    return np.where(bright > 0, weight, 1.0)


def _around(texels: np.ndarray, resolution: int, steps: int) -> np.ndarray:
    """Return texels and those within steps of them on the lightmap, (k,) int64, flat indices, ascending."""
    reach = np.arange(-steps, steps + 1)
    atlas, texel = np.divmod(texels, resolution**2)
    row, column = np.divmod(texel, resolution)
    rows, columns = (np.clip(place[:, None] + reach, 0, resolution - 1) for place in (row, column))
    grown = (atlas[:, None, None] * resolution + rows[:, :, None]) * resolution + columns[:, None, :]
    return np.unique(grown)


def _brightest_around(light: np.ndarray, known: np.ndarray, texels: np.ndarray) -> np.ndarray:
    """Return the largest known light around some texels, (n,) float32, at least 0.

    light   (atlases, r, r) float32
    known   (atlases, r, r) bool
    texels  (n,) int64, flat indices
    """
    resolution, steps = light.shape[1], range(-_AROUND, _AROUND + 1)
    atlas, texel = np.divmod(texels, resolution**2)
    row, column = np.divmod(texel, resolution)
    rows, columns = ([np.clip(place + step, 0, resolution - 1) for step in steps] for place in (row, column))
    brightest = np.zeros(len(texels), np.float32)
    for y in rows:
        for x in columns:
            found = np.where(known[atlas, y, x], light[atlas, y, x], 0)
            np.maximum(brightest, found, out=brightest)
    return brightest
