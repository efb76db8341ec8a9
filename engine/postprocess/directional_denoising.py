"""Directional maps as light, which a filter of light can take noise out of, and back again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from ..scene.color import luminance
from .outputs import DIRECTIONAL_MAPS, PROJECTED_MAPS

#: Part of L1 that is added to E/pi and taken from it: light 10 degrees above the surface has l1 of 6 E(n)/pi.
_PART = np.float32(1 / 6)

#: What the names of both lights end with that carry a map.
CARRIED = (" +", " -")

_L0, *_L1 = DIRECTIONAL_MAPS
_SH_L0, *_SH_L1 = PROJECTED_MAPS


def encode_signed_maps(maps: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return what carries directional maps, images of light by name, each (..., 3) float32.

    A signed map M is the difference of two lights, C + M and C - M, of a light C that is brighter: both have
    the edges and the noise of C, and a filter treats them alike.
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
    """Return directional maps without noise, by name.

    maps      with noise
    filtered  combined and `encode_signed_maps` without it
    normals   (..., 3) float32 of the texels: L0 + L1 . n stays combined
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
    """Yield of each signed map its name, the light that carries it, and what it adds to that."""
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
    """Return part / whole, 0 where there is no whole."""
    whole = np.broadcast_to(whole, part.shape)
    return np.divide(part, whole, out=np.zeros_like(part), where=whole > 0)
