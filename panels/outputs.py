"""Outputs panel: the maps that a bake writes, and the format of their files."""

from __future__ import annotations

import bpy

from ..engine.outputs import OUTPUTS
from ..operators.output_switches import output_switches
from .sidebar import SubPanel, split_properties

#: Settings of each file format.
_OF_FORMAT = {
    "exr": ("exr_depth", "exr_codec"),
    "hdr": (),
    "ktx2": (),
    "png": ("png_depth", "exposure"),
    "rgbm": ("light_range", "light_gamma"),
    "rgbd": ("light_range", "light_gamma"),
    "logluv": (),
}


class HEMIBAKE_PT_outputs(SubPanel, bpy.types.Panel):
    """Switches of the maps, settings of ambient occlusion, folder, name and format of the files."""

    bl_label = "Outputs"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.hemibake
        split_properties(layout)
        maps = layout.column(align=True, heading="Maps")
        for name in output_switches():
            maps.prop(settings, name)
        for output, entry in OUTPUTS.items():
            for name in entry.settings if output in settings.outputs else ():
                layout.prop(settings, name)
        layout.prop(settings, "directory")
        layout.prop(settings, "file_name", placeholder="Automatic")
        for name in ("file_format", *_OF_FORMAT[settings.file_format]):
            layout.prop(settings, name)


CLASSES = (HEMIBAKE_PT_outputs,)
