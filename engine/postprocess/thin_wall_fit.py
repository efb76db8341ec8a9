"""Least-squares fit with relative error for texels at walls thinner than a texel, against light leaks.

Such a texel is read by lookups on a lit and on a dark side. Its mean leaks: perceived contrast is relative
(Weber's law), so a bright line appears on the dark side. Minimizing the relative error moves the light step
to the lit side, where it resembles a contact shadow.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..array_ops import range_members, run_numbers, run_starts
from ..device.buffers import upload_float4
from ..device.cl_device import ComputeDevice
from ..patches.seams import no_seams
from .device_bilinear_equations import DeviceBilinearEquations
from .device_bilinear_fit import DeviceBilinearFit
from .device_images import DeviceTexels
from .lightmap_points import LightmapPoints, centre_points, joined_points
from .texel_samples import TexelSamples

#: Lower limit of the light in weights, as a fraction of the brightest light nearby; it bounds the weights.
_FAINT = 1 / 20

#: Distance in texels from samples inside a wall up to which texels are fitted.
_REACH = 1

#: Radius in texels of the neighbourhood whose brightest light is the reference.
_AROUND = 2

#: Weight of texels that keep their value.
_FIXED = 100.0


class ThinWallFit:
    """Fit of the texels within one texel of a thin wall; minimizes the relative error of bilinear lookups.

    samples:  samples of all texels
    visible:  (s,) bool, valid samples
    light:    (s,) float32, E/pi of the samples, sum of the channels
    inside:   (k,) int64, indices of samples inside thin walls
    shown:    light of each texel before this fit, E/pi, sum of the channels
    known:    (atlases, r, r) bool, texels with valid light
    texels:   (t,) int64, flat indices of the fitted texels
    centres:  (p,) int64, flat indices of the texels whose centre is a sample of the fit
    """

    def __init__(
        self,
        compute: ComputeDevice,
        samples: TexelSamples,
        visible: np.ndarray,
        light: np.ndarray,
        inside: np.ndarray,
        shown: DeviceTexels,
        known: np.ndarray,
    ) -> None:
        resolution = known.shape[1]
        flat = known.ravel()
        near = _around(samples.subset(inside).keys(resolution), known.shape, _REACH)
        self.texels = near[flat[near]]
        around = _around(self.texels, known.shape, 1)

        # Equations demand the light of samples next to the wall, of centres of fitted texels without samples,
        # and of texels that keep their value.
        is_around, beside, stays = (np.zeros(known.size, bool) for _ in range(3))
        is_around[around] = True
        self._samples, keys = _samples_in(samples, is_around, resolution)
        shows = visible[self._samples] & (samples.weight[self._samples] > 0)
        self._samples, keys = self._samples[shows], keys[shows]
        beside[self.texels] = True
        farther = _around(around, known.shape, 1)
        stays[farther[flat[farther] & ~beside[farther]]] = True
        beside[keys] = False
        self.centres = np.flatnonzero(stays | beside)

        # Scale the error of each equation by the brightest light nearby.
        brightness = _Brightness(shown, known, np.union1d(around, self.centres))
        weight = samples.weight[self._samples] * brightness.weight(keys, light[self._samples])
        chosen = LightmapPoints(samples.atlas[self._samples], samples.position[self._samples], weight)
        weight = brightness.weight(self.centres, brightness.of(self.centres))
        weight[stays[self.centres]] *= _FIXED
        centres = centre_points(self.centres, resolution)
        points = joined_points(chosen, LightmapPoints(centres.atlas, centres.position, weight))
        self._order = np.argsort(points.texels(resolution), kind="stable")
        nowhere = np.zeros(known.shape, bool)
        equations = DeviceBilinearEquations(compute, nowhere, points.subset(self._order), no_seams())
        self._compute, self._fit = compute, DeviceBilinearFit(compute, equations, tight=True)
        self._unknown = np.searchsorted(equations.texel, self.texels)

    def light(self, samples: np.ndarray, at_centres: np.ndarray) -> np.ndarray:
        """Return the light of the fitted `texels`, (t, c) float32.

        samples:     (s, 3) or (s,) float32, values of all samples
        at_centres:  (p, c) float32, values of the texels `centres` without this fit
        """
        values = samples.reshape(len(samples), -1)[self._samples]
        colors = [np.broadcast_to(some, (len(some), 3)) for some in (values, at_centres)]
        points = np.concatenate(colors)[self._order]
        largest = float(np.abs(points).max(initial=0))
        light: np.ndarray = self._fit.unknowns(upload_float4(self._compute, points), largest)
        return light[self._unknown, : at_centres.shape[1]]


def _samples_in(samples: TexelSamples, chosen: np.ndarray, resolution: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the samples in the texels of a mask, (k,) int64, ascending, and their texels, (k,) int64, flat.

    chosen:  (atlases * r * r,) bool
    """
    texels = samples.texels(resolution)
    some = np.flatnonzero(chosen[texels])
    count = np.diff(samples.starts, append=len(samples))[some]
    return range_members(samples.starts[some], count), np.repeat(texels[some], count)


def _relative_weight(light: np.ndarray, bright: np.ndarray) -> np.ndarray:
    """Return weights of squared errors, (n,), that make errors of `light` relative; 1 if brightest."""
    weight: np.ndarray = (bright / np.maximum(light, _FAINT * np.maximum(bright, 1e-30))) ** 2
    return np.where(bright > 0, weight, 1.0)


def _around(texels: np.ndarray, shape: tuple[int, ...], steps: int) -> np.ndarray:
    """Return all texels within `steps` of the given ones, (k,) int64, flat indices, ascending.

    shape:  (atlases, r, r) of the lightmaps
    """
    around = np.zeros(shape, bool)
    flat = around.ravel()
    for index in _steps_from(texels, shape[1], steps):
        flat[index] = True
    return np.flatnonzero(flat)


def _steps_from(texels: np.ndarray, resolution: int, steps: int) -> Iterator[np.ndarray]:
    """Yield the texels displaced by each offset within `steps`, (n,) int64, flat, clamped to the edge."""
    reach = range(-steps, steps + 1)
    before, column = np.divmod(texels, resolution)
    row = before % resolution
    columns = [np.clip(column + step, 0, resolution - 1) - column for step in reach]
    for step in reach:
        there = texels + resolution * (np.clip(row + step, 0, resolution - 1) - row)
        yield from (there + across for across in columns)


class _Brightness:
    """Light of the known texels around given texels, (n,) int64, flat indices.

    shown:  light of all texels, one channel
    known:  (atlases, r, r) bool
    """

    def __init__(self, shown: DeviceTexels, known: np.ndarray, texels: np.ndarray) -> None:
        self._resolution = known.shape[1]
        near = _around(texels, known.shape, _AROUND)
        near = near[known.ravel()[near]]
        self._light = np.zeros(known.size, np.float32)
        self._light[near] = shown.rows(near)[:, 0]

    def of(self, texels: np.ndarray) -> np.ndarray:
        """Return the light of texels, (k,) float32; 0 where it is unknown."""
        return self._light[texels]

    def weight(self, texels: np.ndarray, light: np.ndarray) -> np.ndarray:
        """Return weights of squared errors, (k,), relative to the brightest light around each texel."""
        starts = run_starts(texels)
        return _relative_weight(light, self._largest_around(texels[starts])[run_numbers(starts, len(texels))])

    def _largest_around(self, texels: np.ndarray) -> np.ndarray:
        """Return the maximum known light around texels, (k,) float32, at least 0."""
        largest = np.zeros(len(texels), np.float32)
        for index in _steps_from(texels, self._resolution, _AROUND):
            np.maximum(largest, self._light.take(index), out=largest)
        return largest
