"""Converts materials from Blender's working colour space to linear Rec.709."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from typing import ParamSpec

import numpy as np

from ....engine.scene.color import srgb_to_linear
from ....engine.scene.model import BackSide, Material
from ....engine.scene.texture import Texture
from ....engine.scene.transmission import Transmission, Transmittance
from ...working_space import from_rec709, is_rec709, to_rec709

Parameters = ParamSpec("Parameters")


def in_rec709(read: Callable[Parameters, Material]) -> Callable[Parameters, Material]:
    """Decorate a function that reads a material: convert its colours to linear Rec.709, clamped at 0.

    Constants are in the working space, while the pixels of textures are Rec.709 already. A colour times a
    texture is multiplied in the working space, as in Cycles.
    """

    @wraps(read)
    def converted(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Material:
        material = read(*args, **kwargs)
        return material if is_rec709() else _converted(material)

    return converted


def _converted(material: Material) -> Material:
    """Return a material with all constants in Rec.709."""
    reflectance, reflectance_map = _quantity(material.reflectance, material.reflectance_map, 1)
    emission, emission_map = _quantity(material.emission, material.emission_map)
    translucency, translucency_map = _quantity(material.translucency, material.translucency_map, 1)
    return replace(
        material,
        reflectance=reflectance,
        reflectance_map=reflectance_map,
        emission=emission,
        emission_map=emission_map,
        translucency=translucency,
        translucency_map=translucency_map,
        transmission=_transmission(material.transmission),
        back=None if material.back is None else _back(material.back),
    )


def _back(back: BackSide) -> BackSide:
    reflectance, reflectance_map = _quantity(back.reflectance, back.reflectance_map, 1)
    emission, emission_map = _quantity(back.emission, back.emission_map)
    return BackSide(reflectance, emission, reflectance_map, emission_map)


def _quantity(
    constant: np.ndarray, texture: Texture | None, most: float = np.inf
) -> tuple[np.ndarray, Texture | None]:
    """Convert a constant, (3,) float32, times a Rec.709 texture to Rec.709.

    `most`: maximum of the constant.
    """
    grey = not np.ptp(constant)
    if texture is None or texture.pixels.shape[2] == 1:
        return (constant if grey else np.clip(to_rec709(constant), 0, most)), texture
    if grey:
        outside = texture.pixels.min() < 0
        return constant, replace(texture, pixels=np.maximum(texture.pixels, 0)) if outside else texture
    linear = srgb_to_linear(texture.pixels) if texture.srgb else texture.pixels
    pixels = np.maximum(to_rec709(from_rec709(linear) * constant), 0).astype(np.float32)
    return np.ones(3, np.float32), replace(texture, pixels=pixels, srgb=False)


def _transmission(transmission: Transmission) -> Transmission:
    """Return a transmission with all constants in Rec.709."""
    sides = {name: getattr(transmission, name) for name in ("shadow", "bounce", "shadow_back", "bounce_back")}
    return Transmission(**{name: side and _transmittance(side) for name, side in sides.items()})


def _transmittance(side: Transmittance) -> Transmittance:
    """Return a transmittance in Rec.709; it is linear in its constants, because its textures are grey."""
    if not (np.ptp(side.offset) or np.ptp(side.scale)):
        return side
    whole = np.clip(to_rec709(side.offset + side.scale), 0, 1)
    offset = np.clip(to_rec709(side.offset), 0, 1)
    return replace(side, offset=offset, scale=whole - offset)
