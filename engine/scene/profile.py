"""Photometric profiles: directional factors of a light's strength, and the IES file parser."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import SceneError

#: Watts per candela: 4 pi over the luminous efficacy of D65, 177.83 lm/W (Cycles, util/ies.cpp).
_WATT = 4 * np.pi / 177.83

#: Photometric types of LM-63.
_TYPE_C, _TYPE_B, _TYPE_A = 1, 2, 3

#: Tolerance for equal angles, degrees.
_SAME = 1e-4


@dataclass(frozen=True)
class Profile:
    """Directional factors of a light's strength, in the light's local space.

    azimuths:  (m,) float32, radians, ascending in [0, 2 pi]: atan2(x, y) + pi of a direction
    polars:    (n,) float32, radians, ascending in [0, pi]: angle from -z
    factors:   (m, n, 3) float32, >= 0; interpolated by cubics (Catmull and Rom 1974); 0 beyond the outermost
               angles
    """

    azimuths: np.ndarray
    polars: np.ndarray
    factors: np.ndarray

    @property
    def mean(self) -> np.ndarray:
        """Approximate mean over all directions, (3,) float64; 0 only if all factors are 0."""
        factors = self.factors.astype(np.float64)
        weights = _widths(self.azimuths)[:, None] * (_widths(self.polars) * np.sin(self.polars))
        mean = np.einsum("mn,mnc->c", weights, factors) / (4 * np.pi)
        return np.maximum(mean, 1e-3 * factors.max(axis=(0, 1)))

    @property
    def packed(self) -> np.ndarray:
        """Numbers of angles, angles, and factors with a border for modulation.cl, (k,) float32.

        The border holds the values that cubics read beyond the outermost angles, measured in Cycles 5.0.
        These are the values around the lower pole mirrored, the first azimuth and the last polar angle
        repeated, and for the last azimuth the one before it.
        """
        columns, rows = np.arange(len(self.azimuths)), np.arange(len(self.polars))
        below = 1 if self.polars[0] == 0 else 0
        bordered = self.factors[np.r_[0, columns, columns[-2]]][:, np.r_[below, rows, rows[-1]]]
        sizes = np.array([len(self.azimuths), len(self.polars)])
        parts = (sizes, self.azimuths, self.polars, bordered.ravel())
        return np.concatenate([part.astype(np.float32) for part in parts])


def _widths(angles: np.ndarray) -> np.ndarray:
    """Return quadrature weights of ascending angles, for an integral over their interval."""
    gaps = np.diff(angles.astype(np.float64))
    return (np.r_[gaps, 0] + np.r_[0, gaps]) / 2


def check_profile(profile: Profile, name: str) -> None:
    """Raise SceneError with the light's name if a profile is invalid."""
    angles = (profile.azimuths, profile.polars)
    ascending = all(len(values) > 1 and (np.diff(values) > 0).all() for values in angles)
    shape = (len(profile.azimuths), len(profile.polars), 3)
    if not ascending or profile.factors.shape != shape:
        raise SceneError(f"Light '{name}' has a profile whose angles do not ascend. Correct the profile.")
    if not np.isfinite(profile.factors).all() or profile.factors.min() < 0:
        raise SceneError(
            f"Light '{name}' has a profile that is NaN, infinite or negative. Correct the profile."
        )


def read_ies(text: str) -> Profile:
    """Return the profile of an IES file: factors of a power in W, as in Cycles.

    Format: ANSI/IES LM-63. Types A and B are converted to C, and symmetric parts are mirrored (Cycles,
    util/ies.cpp). Raises SceneError that describes the fault in the file.
    """
    words = _words(text)
    head = _numbers(words, 0, 13)
    polars, azimuths, kind = (int(value) for value in head[3:6])
    if polars < 2 or azimuths < 1 or kind not in _TURNS:
        raise SceneError(
            f"it has {polars:.6g} vertical and {azimuths:.6g} horizontal angles of type {kind:.6g}"
        )
    values = _numbers(words, 13, polars + azimuths + polars * azimuths)
    vertical, horizontal, candelas = np.split(values, [polars, polars + azimuths])
    candelas = candelas.reshape(azimuths, polars) * (head[2] * head[10] * head[11] * _WATT)
    horizontal, vertical, candelas = _TURNS[kind](horizontal, vertical, candelas)
    if (np.diff(horizontal) <= 0).any() or (np.diff(vertical) <= 0).any() or len(vertical) < 2:
        raise SceneError("its angles do not ascend")
    azimuth, polar = (np.radians(angles).astype(np.float32) for angles in (horizontal, vertical))
    grey = np.maximum(candelas, 0).astype(np.float32)
    return Profile(azimuth, polar, np.repeat(grey[..., None], 3, axis=2))


def _words(text: str) -> list[str]:
    """Return the numbers of an IES file as words: everything after the line TILT= and the tilt data."""
    lines = iter(text.splitlines())
    tilt = next((line for line in lines if line.startswith("TILT=")), None)
    if tilt is None:
        raise SceneError("it has no line TILT=")
    words = " ".join(lines).replace(",", " ").split()
    if tilt.strip() != "TILT=INCLUDE":
        return words
    return words[2 + 2 * int(_numbers(words, 1, 1)[0]) :]


def _numbers(words: Sequence[str], first: int, count: int) -> np.ndarray:
    """Return the next `count` words as float64; raise SceneError if one is missing or not a number."""
    if len(words) < first + count:
        raise SceneError("it ends too early")
    try:
        numbers = np.array([float(word) for word in words[first : first + count]])
    except ValueError as error:
        raise SceneError(f"it has a word instead of a number ({error})") from error
    if not np.isfinite(numbers).all():
        raise SceneError("it has infinite numbers")
    return numbers


#: Photometric web: horizontal and vertical angles, degrees, and candelas, (horizontal, vertical).
_Web = tuple[np.ndarray, np.ndarray, np.ndarray]


def _from_type_a(horizontal: np.ndarray, vertical: np.ndarray, candelas: np.ndarray) -> _Web:
    """Convert type A: -90 to 90 degrees about the horizon, or the mirrored half from 0 on."""
    turned, web = 180 - horizontal[::-1], candelas[::-1]
    if _same(horizontal[0], 0):
        turned, web = np.r_[turned, 180 + horizontal[1:]], np.concatenate([web, candelas[1:]])
    return turned, vertical + 90, web


def _from_type_b(horizontal: np.ndarray, vertical: np.ndarray, candelas: np.ndarray) -> _Web:
    """Convert type B: like type A with a horizontal pole, so the angles are swapped as in Cycles."""
    azimuths, polars, web = vertical, horizontal, candelas.T
    if _same(azimuths[0], 0):
        azimuths, web = np.r_[-azimuths[:0:-1], azimuths], np.concatenate([web[:0:-1], web])
    if _same(polars[0], 0):
        polars = np.r_[-polars[:0:-1], polars]
        web = np.concatenate([web[:, :0:-1], web], axis=1)
    return azimuths + 90, polars + 90, web


def _from_type_c(horizontal: np.ndarray, vertical: np.ndarray, candelas: np.ndarray) -> _Web:
    """Convert type C: about the vertical axis, the full circle or a half, quarter or smaller part of it."""
    if _same(horizontal[0], 90):
        horizontal = horizontal - 90
    if len(horizontal) == 1:
        return np.array([0.0, 360.0]), vertical, np.concatenate([candelas, candelas])
    for half in (90, 180):
        if _same(horizontal[-1], half):
            horizontal = np.r_[horizontal, 2 * half - horizontal[-2::-1]]
            candelas = np.concatenate([candelas, candelas[-2::-1]])

    # Files may omit 360 degrees, which equals 0.
    gap, steps = 360 - horizontal[-1], np.diff(horizontal)
    if _same(horizontal[0], 0) and (_same(steps[0], gap) or _same(steps[-1], gap)):
        horizontal, candelas = np.r_[horizontal, 360], np.concatenate([candelas, candelas[:1]])
    return horizontal, vertical, candelas


def _same(first: float, second: float) -> bool:
    return bool(abs(first - second) < _SAME)


_TURNS = {_TYPE_A: _from_type_a, _TYPE_B: _from_type_b, _TYPE_C: _from_type_c}
