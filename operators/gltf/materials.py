"""Adds lightmaps to glTF materials: copies of the materials that Blender's exporter made."""

from __future__ import annotations

import copy
from typing import Any

from io_scene_gltf2.io.com import gltf2_io
from io_scene_gltf2.io.com.gltf2_io_extensions import Extension

from .encoded import RADIANCE, EncodedLightmap

#: Constants of the glTF specification: GL_LINEAR and GL_CLAMP_TO_EDGE.
_LINEAR, _CLAMP = 9729, 33071

#: Colour of surfaces without a material, as in previews.
_GREY = 0.8


class LitMaterials:
    """Materials with lightmaps, one for each pair of both; the second UV set holds lightmap UVs.

    binary:  makes the exporter's type for binary data; None if images are separate files
    uris:    URIs of these files by the names of the lightmaps
    """

    def __init__(self, binary: Any, uris: dict[str, str]) -> None:
        self._binary, self._uris = binary, uris
        self._sampler = gltf2_io.Sampler(None, None, _LINEAR, _LINEAR, None, _CLAMP, _CLAMP)
        self._textures: dict[str, gltf2_io.Texture] = {}
        self._materials: dict[tuple, tuple[gltf2_io.Material | None, gltf2_io.Material]] = {}

    def lit(
        self, material: gltf2_io.Material | None, lightmap: EncodedLightmap, swapped: int
    ) -> gltf2_io.Material | None:
        """Return a copy of a material with a lightmap, or without it if the file has none.

        swapped:  UV set that was exchanged with the second one; 1 if none was
        """
        if not lightmap.kind and (material is None or swapped == 1):
            return material
        key = (id(material), lightmap.name, swapped)
        if key not in self._materials:
            made: gltf2_io.Material = _grey() if material is None else _swapped(material, swapped)
            if lightmap.kind:
                extension = {"index": self._texture(lightmap), "texCoord": 1, "intensity": lightmap.intensity}
                if lightmap.groups:
                    extension["extras"] = {"hemibake": {"groups": self._groups(lightmap)}}
                lightmaps = {"MOZ_lightmap": Extension("MOZ_lightmap", extension, required=False)}
                made.extensions = {**(made.extensions or {}), **lightmaps}
            # The original is stored as well, so that no other object gets its id.
            self._materials[key] = material, made
        return self._materials[key][1]

    def colored(self, material: gltf2_io.Material | None) -> gltf2_io.Material:
        """Return an unlit copy of a material, which shows its color times the colors of vertices."""
        key = (id(material), "vertices")
        if key not in self._materials:
            made = _grey() if material is None else copy.copy(material)
            unlit = {"KHR_materials_unlit": Extension("KHR_materials_unlit", {}, required=False)}
            made.extensions = {**(made.extensions or {}), **unlit}
            self._materials[key] = material, made
        return self._materials[key][1]

    def _groups(self, lightmap: EncodedLightmap) -> dict[str, dict]:
        """Return texture and intensity of each light group of a lightmap."""
        return {
            name: {"index": self._texture(group), "intensity": group.intensity}
            for name, group in lightmap.groups.items()
        }

    def _texture(self, lightmap: EncodedLightmap) -> gltf2_io.Texture:
        """Return the texture of a lightmap; glTF has no HDR images, but MOZ_texture_rgbe has."""
        if lightmap.name not in self._textures:
            image, extensions = self._image(lightmap), None
            if lightmap.kind == RADIANCE:
                source = {"source": image}
                extensions = {"MOZ_texture_rgbe": Extension("MOZ_texture_rgbe", source, required=False)}
                image = None
            texture = gltf2_io.Texture(extensions, None, lightmap.name, self._sampler, image)
            self._textures[lightmap.name] = texture
        return self._textures[lightmap.name]

    def _image(self, lightmap: EncodedLightmap) -> gltf2_io.Image:
        uri = self._uris.get(lightmap.name)
        view = None if uri else self._binary(lightmap.data)
        return gltf2_io.Image(view, None, None, lightmap.kind, lightmap.name, uri)


class UnlitMaterials(LitMaterials):
    """Materials that show complete maps without light, one for each map; the first UV set holds its UVs."""

    def unlit(self, material: gltf2_io.Material | None, complete: EncodedLightmap) -> gltf2_io.Material:
        """Return the material of a complete map, which keeps only the sides of an original."""
        both = material is None or bool(material.double_sided)
        key = (complete.name, both)
        if key not in self._materials:
            texture = gltf2_io.TextureInfo(None, None, self._texture(complete), 0)
            factors = gltf2_io.MaterialPBRMetallicRoughness(None, texture, None, None, 0.0, None, 1.0)
            unlit = {"KHR_materials_unlit": Extension("KHR_materials_unlit", {}, required=False)}
            self._materials[key] = (
                None,
                gltf2_io.Material(
                    None, None, both, None, None, unlit, None, complete.name, None, None, factors
                ),
            )
        return self._materials[key][1]


def _grey() -> gltf2_io.Material:
    """Return the material for surfaces without one."""
    factors = gltf2_io.MaterialPBRMetallicRoughness(
        [_GREY, _GREY, _GREY, 1.0], None, None, None, 0.0, None, 1.0
    )
    return gltf2_io.Material(None, None, True, None, None, None, None, "No material", None, None, factors)


def _swapped(value: object, swapped: int) -> object:
    """Return a copy of a material, or of a part of it, in which UV sets 1 and `swapped` are exchanged."""
    if isinstance(value, dict):
        return {name: _swapped(part, swapped) for name, part in value.items()}
    if not hasattr(value, "__dict__") or isinstance(value, gltf2_io.Texture):
        return value
    made = copy.copy(value)
    for name, part in vars(value).items():
        setattr(made, name, _swapped(part, swapped))
    if hasattr(made, "tex_coord"):
        made.tex_coord = {swapped: 1, 1: swapped}.get(made.tex_coord or 0, made.tex_coord)
    return made
