"""Encoding of signed directional maps as pairs of nonnegative images, which OIDN can denoise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from ..outputs import DIRECTIONAL_MAPS, PROJECTED_MAPS
from ..scene.color import luminance

#: Scale of L1 relative to E/pi in the pair. Light at 10 degrees above the surface has |L1| = 6 E/pi, so the
#: factor keeps nearly all pairs nonnegative.
_PART = np.float32(1 / 6)

#: Suffixes of the names of the two images that encode a signed map.
CARRIED = (" +", " -")

_L0, *_L1 = DIRECTIONAL_MAPS
_SH_L0, *_SH_L1 = PROJECTED_MAPS


def encode_signed_maps(maps: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return nonnegative images that encode directional maps, by name, each (..., 3) float32.

    A signed map M becomes the two images C + M and C - M of a brighter carrier image C, such as the
    irradiance. Both have the edges and the noise of C, so the filter treats them alike.
    """
    images: dict[str, np.ndarray] = {}
    for name, carrier, change in _changes(maps):
        for sign, image in zip(CARRIED, (carrier + change, carrier - change), strict=True):
            images[name + sign] = np.maximum(image, 0)
    if _SH_L0 in maps:
        images[_SH_L0] = maps[_SH_L0]
    return images


def restored_maps(
    maps: Mapping[str, np.ndarray], filtered: Mapping[str, np.ndarray], normals: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the denoised directional maps, by name.

    maps:      maps with noise
    filtered:  denoised "combined" and denoised images of `encode_signed_maps`
    normals:   (..., 3) float32, normals of the texels; L0 is set so that L0 + L1 . n equals "combined"
    """
    restored = {}
    for name, *_ in _changes(maps):
        bright, dark = (filtered[name + sign] for sign in CARRIED)
        if name in _SH_L1:
            restored[name] = _ratio(bright - dark, bright + dark)
        elif name in _L1:
            restored[name] = (bright - dark) / (2 * _PART)
        else:
            light = luminance(filtered["combined"])[..., None]
            restored[name] = _ratio(bright - dark, 2 * _PART * light)
    if _L0 in maps:
        along = sum(normals[..., axis, None] * restored[name] for axis, name in enumerate(_L1))
        restored[_L0] = filtered["combined"] - along
    if _SH_L0 in maps:
        restored[_SH_L0] = filtered[_SH_L0]
    return restored


def _changes(maps: Mapping[str, np.ndarray]) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield each signed map: name, nonnegative carrier image C, scaled map M (`encode_signed_maps`)."""
    for name in _L1:
        if name in maps:
            yield name, maps["combined"], _PART * maps[name]
    for name in _SH_L1:
        if name in maps:
            yield name, maps[_SH_L0], maps[_SH_L0] * maps[name]
    if "dominant_direction" in maps:
        light = luminance(maps["combined"])[..., None] * np.ones(3, np.float32)
        yield "dominant_direction", light, _PART * light * maps["dominant_direction"]


def _ratio(part: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """Return part / whole; 0 where the whole is 0."""
    whole = np.broadcast_to(whole, part.shape)
    return np.divide(part, whole, out=np.zeros_like(part), where=whole > 0)
