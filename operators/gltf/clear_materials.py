"""Replaces transmission in glTF materials by alpha blending, as Godot has no KHR_materials_transmission.

A face of glass transmits sqrt(base color) x (1 - F), as in bakes, and a blended face transmits 1 - alpha in
all channels. Alpha is that of the least transmitted channel, times the alpha of the material. What the others
transmit more becomes the color of the surface, in the light of its lightmap.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable

import numpy as np
from io_scene_gltf2.io.com import gltf2_io

_TRANSMISSION, _IOR = "KHR_materials_transmission", "KHR_materials_ior"

#: Index of refraction of KHR_materials_ior without a value.
_GLASS = 1.5


def blend_clear_materials(materials: Iterable[gltf2_io.Material]) -> list[str]:
    """Blend the materials with transmission; return the names of those with textures, which stay opaque."""
    textured = []
    for material in materials:
        transmission = _extension(material, _TRANSMISSION)
        factor = float(transmission.get("transmissionFactor", 0.0))
        if factor <= 0:
            continue
        factors = material.pbr_metallic_roughness
        if "transmissionTexture" in transmission or (factors and factors.base_color_texture):
            textured.append(material.name)
            continue
        color = (factors and factors.base_color_factor) or [1.0, 1.0, 1.0, 1.0]
        ior = float(_extension(material, _IOR).get("ior", _GLASS))
        made = copy.copy(factors) or gltf2_io.MaterialPBRMetallicRoughness(
            None, None, None, None, None, None, None
        )
        made.base_color_factor = _blended(np.array(color), factor, ior)
        material.pbr_metallic_roughness, material.alpha_mode = made, "BLEND"
    return list(dict.fromkeys(textured))


def _blended(color: np.ndarray, factor: float, ior: float) -> list[float]:
    """Return the RGBA factor of a face with a base color, RGBA (4,), and a transmission factor."""
    color, cover = color[:3], float(color[3])
    reflected = ((ior - 1) / (ior + 1)) ** 2
    through = factor * (1 - reflected) * np.sqrt(np.clip(color, 0, 1))
    least = float(through.min())
    rest = through - least + (1 - factor) * color
    alpha = 1 - least
    return [*(float(value) for value in np.clip(rest / max(alpha, 1e-6), 0, 1)), cover * alpha]


def _extension(material: gltf2_io.Material, name: str) -> dict:
    """Return the content of an extension of a material; empty without it."""
    found = (material.extensions or {}).get(name)
    return {} if found is None else found.extension
