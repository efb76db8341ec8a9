"""The Export operator: the baked scene as a glTF file with its lightmaps."""

from __future__ import annotations

import os
from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from ..engine.errors import EngineError
from ..engine.object_message import counted
from .report_message import report_message
from .worker_manager import poll_idle

#: Encodings of lightmaps in the file, by the names that people choose.
_KINDS = {"HDR": "image/vnd.radiance", "PNG": "image/png", "NONE": ""}


class HEMIBAKE_OT_export_for_engine(bpy.types.Operator, ExportHelper):
    """Write what is shown as a glTF file with its lightmaps, for three.js, Hubs and game engines"""

    bl_idname = "hemibake.export_for_engine"
    bl_label = "Export for Engine"
    bl_options = {"REGISTER", "UNDO"}

    filename_ext = ".glb"
    filter_glob: StringProperty(default="*.glb;*.gltf", options={"HIDDEN"})
    file_format: EnumProperty(
        name="Format",
        description="Ending of the name that is typed; scripts say it by the path",
        items=[
            (".glb", "glTF Binary (.glb)", "One file"),
            (".gltf", "glTF Separate (.gltf)", "Text, with geometry and images in files of their own"),
        ],
    )
    lightmaps: EnumProperty(
        name="Lightmaps",
        description="How the file holds the lightmaps, in the material extension MOZ_lightmap",
        items=[
            (
                "HDR",
                "Radiance HDR",
                "Colours of any brightness; three.js and Hubs read them (MOZ_texture_rgbe)",
            ),
            ("PNG", "PNG", "8 bits a channel: dark places have steps; for readers of MOZ_lightmap alone"),
            ("NONE", "None", "Final UVs only; for engines that read no MOZ_lightmap, or refuse Radiance HDR"),
        ],
    )
    use_files: BoolProperty(
        name="Lightmaps Beside It",
        description="Write each lightmap as 32-bit OpenEXR, too, for engines that do not know MOZ_lightmap, "
        "and hemibake.json, which tells whose it is",
        default=True,
    )

    def check(self, context: bpy.types.Context) -> bool:
        """Give the name in the file browser the ending of the format."""
        folder, name = os.path.split(self.filepath)
        stem, ending = os.path.splitext(name)
        stem = stem if ending.lower() in (".glb", ".gltf") else name
        named = os.path.join(folder, stem + self.file_format) if name else self.filepath
        changed, self.filepath = named != self.filepath, named
        return changed

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not any(entry.image for entry in context.scene.hemibake.lightmaps):
            cls.poll_message_set("There is no lightmap to export: bake first")
            return False
        return poll_idle(cls)

    def execute(self, context: bpy.types.Context) -> set[str]:
        # Imports Blender's exporter, which takes a while.
        from .gltf.gltf_export import export_for_engine

        path = Path(bpy.path.abspath(self.filepath))
        try:
            made = export_for_engine(context, path, _KINDS[self.lightmaps], self.use_files)
        except EngineError as error:
            report_message(self, "ERROR", str(error))
            return {"CANCELLED"}
        for note in made.notes:
            report_message(self, "WARNING", note)
        self.report({"INFO"}, f"{counted(made.lit, 'object')} with lightmaps exported to '{path.name}'")
        return {"FINISHED"}


CLASSES = (HEMIBAKE_OT_export_for_engine,)
