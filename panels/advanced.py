"""Settings that seldom need a change, in sub-panels by subject."""

from __future__ import annotations

import bpy

from ..operators.chart_settings import CHART_PROPERTIES
from .sidebar import SubPanel, split_properties


class HEMIBAKE_PT_advanced(SubPanel, bpy.types.Panel):
    """Parent of the advanced sub-panels, with the choice of meshes."""

    bl_label = "Advanced"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        split_properties(self.layout)
        self.layout.prop(context.scene.hemibake, "meshes")


class _SettingsPanel(SubPanel):
    """Sub-panel of Advanced that draws the properties of the scene named in `_names`, one below another."""

    bl_parent_id = "HEMIBAKE_PT_advanced"
    bl_options = {"DEFAULT_CLOSED"}
    _names: tuple[str, ...]
    layout: bpy.types.UILayout

    def draw(self, context: bpy.types.Context) -> None:
        split_properties(self.layout)
        for name in self._names:
            self.layout.prop(context.scene.hemibake, name)


class HEMIBAKE_PT_light(_SettingsPanel, bpy.types.Panel):
    """Samples and bounces."""

    bl_label = "Light"
    _names = (
        "max_bounces", "tolerance", "samples", "light_samples", "adaptive", "sample_emission",
        "glass_transmits", "accelerate", "seed",
    )  # fmt: skip


class HEMIBAKE_PT_texels(_SettingsPanel, bpy.types.Panel):
    """Supersampling, seams and margins of texels."""

    bl_label = "Texels"
    _names = ("texel_samples", "hide_seams", "margin")


class HEMIBAKE_PT_uvs(_SettingsPanel, bpy.types.Panel):
    """Layer and packing of lightmap UVs."""

    bl_label = "UVs"
    _names = ("uv_layer", "padding", "mip_level")


class HEMIBAKE_PT_charts(_SettingsPanel, bpy.types.Panel):
    """Segmentation of meshes into charts for new lightmap UVs."""

    bl_parent_id = "HEMIBAKE_PT_uvs"
    bl_label = "Charts"
    _names = CHART_PROPERTIES


class HEMIBAKE_PT_probe_files(_SettingsPanel, bpy.types.Panel):
    """Further files of light probes."""

    bl_label = "Light Probes"
    _names = ("probe_distances",)


class HEMIBAKE_PT_memory(_SettingsPanel, bpy.types.Panel):
    """Settings that trade memory for time."""

    bl_label = "Memory"
    _names = ("method", "visibility", "patch_groups", "patch_file")


class HEMIBAKE_PT_paper(_SettingsPanel, bpy.types.Panel):
    """Settings of the paper's hemicubes, which the default method does not draw."""

    bl_label = "Paper"
    _names = ("hemicube", "directions", "rotate", "align_uvs", "half_radiance", "array_size")


CLASSES = (
    HEMIBAKE_PT_advanced,
    HEMIBAKE_PT_light,
    HEMIBAKE_PT_texels,
    HEMIBAKE_PT_uvs,
    HEMIBAKE_PT_charts,
    HEMIBAKE_PT_probe_files,
    HEMIBAKE_PT_memory,
    HEMIBAKE_PT_paper,
)
