"""Converts surfaces to the engine's materials."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ....engine.scene.cutouts import transmission_maps
from ....engine.scene.model import BackSide, Material
from ....engine.scene.texture import Texture
from ....engine.scene.transmission import CLEAR, OPAQUE, Fresnel, Transmission, Transmittance, from_opacity
from .sockets import ComplexError
from .values import HOLE, DiffuseSurface, MaterialValue

#: Largest straight-through transmittance of a surface that also emits or reflects. The engine stores light
#: for the opaque part of the surface, which therefore cannot be 0. Light through a glowing surface loses 1.6
#: % at most.
MAX_SHARED = 1 - 1 / 64

#: Tolerance of sums up to 1 for rounding.
_ROUNDING = 1e-6


@dataclass(frozen=True)
class Sides:
    """Surfaces for each kind of ray and side.

    None for shadow rays means equal to `bounce`; None for back sides means equal to the front.

    bounce:       front, for gathered light
    shadow:       front, for shadow rays to lights
    bounce_back:  back, for gathered light
    shadow_back:  back, for shadow rays to lights
    """

    bounce: DiffuseSurface
    shadow: DiffuseSurface | None = None
    bounce_back: DiffuseSurface | None = None
    shadow_back: DiffuseSurface | None = None


@np.errstate(over="ignore", invalid="ignore")
def to_material(name: str, sides: Sides) -> Material:
    """Convert surfaces to the engine's material.

    Raises ComplexError for a threshold on tinted light, and for textures times more than 1, which must be
    clipped texel by texel. Values that are not finite are kept, and `engine.scene.checks` rejects them.
    """
    front = _physical(sides.bounce)
    transmission = Transmission(
        shadow=_transmittance(front if sides.shadow is None else sides.shadow), bounce=_transmittance(front)
    )
    material = Material(
        name,
        _array(front.reflect),
        _array(front.emit),
        reflectance_map=front.reflect.texture,
        emission_map=front.emit.texture,
        translucency=_array(front.transmit),
        translucency_map=front.transmit.texture,
        transmission=transmission,
    )
    if sides.bounce_back is None:
        return material
    back = _physical(sides.bounce_back)
    shadow_back = back if sides.shadow_back is None else sides.shadow_back
    transmission = replace(
        transmission, shadow_back=_transmittance(shadow_back), bounce_back=_transmittance(back)
    )
    return replace(
        material,
        transmission=transmission,
        back=BackSide(_array(back.reflect), _array(back.emit), back.reflect.texture, back.emit.texture),
    )


def hide_from_rays(material: Material, from_shadow: bool, from_bounces: bool) -> Material:
    """Return a material that is transparent to shadow rays, gather rays (then it is black) or both."""
    transmission = material.transmission
    if from_shadow:
        transmission = replace(transmission, shadow=CLEAR, shadow_back=None)
    if not from_bounces:
        return replace(material, transmission=transmission)
    transmission = replace(transmission, bounce=CLEAR, bounce_back=None)
    black = np.zeros(3, np.float32)
    return replace(
        material, reflectance=black, reflectance_map=None, emission=black, emission_map=None,
        translucency=black, translucency_map=None, back=None, transmission=transmission,
    )  # fmt: skip


def block_shadow_rays(material: Material) -> Material:
    """Return a material that blocks shadow rays, as without *Transparent Shadows*; glass stays unchanged.

    In Cycles, glass always blocks shadow rays, and the light that it refracts arrives by bounces.
    """
    kept = material.transmission
    front = OPAQUE if kept.shadow.fresnel is None else kept.shadow
    back = kept.shadow_back
    if back is not None and back.fresnel is None:
        back = OPAQUE
    return replace(material, transmission=replace(kept, shadow=front, shadow_back=back))


def textures_of(material: Material) -> list[Texture]:
    """Return all textures of a material."""
    maps = [material.reflectance_map, material.emission_map, material.translucency_map]
    if material.back is not None:
        maps += [material.back.reflectance_map, material.back.emission_map]
    return [*(texture for texture in maps if texture is not None), *transmission_maps(material)]


def _physical(surface: DiffuseSurface) -> DiffuseSurface:
    """Clamp a surface to physical values, and divide light by its opaque fraction.

    Before the division, reflected, transmitted and straight-through light of a channel add up to 1 at most.
    Raises ComplexError if that depends on a texture.
    """
    if surface.cover.constant.max() <= 0:
        return HOLE
    through = np.clip(surface.through, 0.0, 1.0)
    reflect, transmit = _not_negative(surface.reflect), _not_negative(surface.transmit)
    emit = _not_negative(surface.emit)
    scattered = reflect.constant + transmit.constant
    is_textured = reflect.texture is not None or transmit.texture is not None
    if is_textured and (scattered + through).max() > 1 + _ROUNDING:
        raise ComplexError
    if scattered.any() or not emit.is_zero:
        through = np.minimum(through, MAX_SHARED)
    room = np.minimum(1.0, (1 - through) / np.maximum(scattered, 1e-30))
    stopped = 1 - through.max()
    factor = 1 / stopped if stopped > 0 else 1.0
    return replace(
        surface, through=through, reflect=MaterialValue(reflect.constant * room * factor, reflect.texture),
        transmit=MaterialValue(transmit.constant * room * factor, transmit.texture), emit=emit * factor,
    )  # fmt: skip


def _transmittance(surface: DiffuseSurface) -> Transmittance:
    """Return the straight-through transmittance of a surface: 1 - cover * (1 - through).

    Raises ComplexError for a threshold on tinted light, and for a texture times more than 1.
    """
    through = np.clip(surface.through, 0.0, 1.0)
    texture, threshold = surface.cover.texture, surface.threshold
    if texture is not None and surface.cover.constant[0] > 1 + _ROUNDING:
        raise ComplexError
    opacity = float(np.clip(surface.cover.constant[0], 0.0, 1.0))
    if not through.any():
        return from_opacity(opacity, texture, threshold)
    if threshold is not None:
        raise ComplexError
    stopped = (opacity * (1 - through)).astype(np.float32)
    fresnel = _fresnel(surface, opacity)
    if texture is None:
        return Transmittance(1 - stopped, fresnel=fresnel)
    return Transmittance(np.ones(3, np.float32), -stopped, texture, fresnel=fresnel)


def _fresnel(surface: DiffuseSurface, opacity: float) -> Fresnel | None:
    """Return the loss of transmittance with the angle of incidence; textures count by their mean."""
    texture = surface.cover.texture
    cover = opacity if texture is None else opacity * float(texture.pixels.mean())
    glass = cover * float(np.clip(surface.glass, 0, 1).mean())
    passed = 1 - cover * (1 - float(np.clip(surface.through, 0, 1).mean()))
    return replace(surface.fresnel, share=min(glass / passed, 1.0)) if surface.fresnel and glass else None


def _not_negative(value: MaterialValue) -> MaterialValue:
    return MaterialValue(np.maximum(value.constant, 0.0), value.texture)


def _array(value: MaterialValue) -> np.ndarray:
    return value.constant.astype(np.float32)
