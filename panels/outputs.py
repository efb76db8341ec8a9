"""What a bake gives, and in which files."""

from __future__ import annotations

import bpy

from .sidebar import SubPanel, split_properties

#: Settings that only some formats have.
_OF_FORMAT = {
    "exr": ("exr_depth", "exr_codec"),
    "hdr": (),
    "png": ("png_depth", "exposure"),
    "rgbm": ("light_range", "light_gamma"),
    "rgbd": ("light_range", "light_gamma"),
    "logluv": (),
}


class HEMIBAKE_PT_outputs(SubPanel, bpy.types.Panel):
    """Outputs of the bake, how ambient occlusion is sampled, and the files."""

    bl_label = "Outputs"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.hemibake
        layout.column().prop(settings, "outputs", expand=True)
        split_properties(layout)
        if "ambient_occlusion" in settings.outputs:
            layout.prop(settings, "ao_samples")
            layout.prop(settings, "ao_distance")
        for name in ("directory", "file_name", "file_format", *_OF_FORMAT[settings.file_format]):
            layout.prop(settings, name)


CLASSES = (HEMIBAKE_PT_outputs,)
