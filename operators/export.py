"""Export operator: writes the baked scene as a glTF file with its lightmaps."""

from __future__ import annotations

import os
from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from ..engine.errors import EngineError
from ..engine.object_message import counted
from .export_engines import ENGINES, engine_items
from .report_message import report_message
from .worker_manager import poll_idle

#: MIME type of embedded lightmaps, by choice; empty for none.
_KINDS = {"HDR": "image/vnd.radiance", "PNG": "image/png", "NONE": ""}


class HEMIBAKE_OT_export_for_engine(bpy.types.Operator, ExportHelper):
    """Write the visible objects and their lightmaps as a glTF file, for three.js, Hubs and game engines"""

    bl_idname = "hemibake.export_for_engine"
    bl_label = "Export for Engine"
    bl_options = {"REGISTER", "UNDO"}

    filename_ext = ".glb"
    engine: EnumProperty(
        name="Engine",
        description="Choose what the files are for",
        items=engine_items(),
        default="FILES",
    )
    filter_glob: StringProperty(default="*.glb;*.gltf", options={"HIDDEN"})
    file_format: EnumProperty(
        name="Format",
        description="Choose the file ending",
        items=[
            (".glb", "glTF Binary (.glb)", "Write a single file"),
            (".gltf", "glTF Separate (.gltf)", "Write text, with geometry and images in further files"),
        ],
    )
    lightmaps: EnumProperty(
        name="Lightmaps",
        description="Choose how lightmaps are embedded by the material extension MOZ_lightmap",
        items=[
            (
                "HDR",
                "Radiance HDR",
                "Embed light of any brightness, for three.js and Hubs (MOZ_texture_rgbe)",
            ),
            ("PNG", "PNG", "Embed 8 bits per channel, for readers without RGBE. Dark light has steps"),
            ("NONE", "None", "Write final UVs only, for engines without MOZ_lightmap"),
        ],
    )
    use_files: BoolProperty(
        name="Separate Lightmaps",
        description="Also write 32-bit OpenEXR files and hemibake.json, for engines without MOZ_lightmap",
        default=True,
    )

    def check(self, context: bpy.types.Context) -> bool:
        """Set the ending of the file name to the format; return True if the name changed."""
        wanted = self.file_format if ENGINES[self.engine].has_options else ".glb"
        folder, name = os.path.split(self.filepath)
        stem, ending = os.path.splitext(name)
        stem = stem if ending.lower() in (".glb", ".gltf") else name
        named = os.path.join(folder, stem + wanted) if name else self.filepath
        changed, self.filepath = named != self.filepath, named
        return changed

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not any(entry.image for entry in context.scene.hemibake.lightmaps):
            cls.poll_message_set("The scene has no lightmaps. Bake first")
            return False
        return poll_idle(cls)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Open the file browser with the engine of the scene's last export, unless a caller has set one."""
        if not self.properties.is_property_set("engine", ghost=False):
            self.engine = context.scene.hemibake.export_engine
        return super().invoke(context, event)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw nothing: a panel of the file browser draws the options."""

    def execute(self, context: bpy.types.Context) -> set[str]:
        # Deferred, because it imports Blender's exporter, which is slow.
        from .gltf.gltf_export import export_for_engine

        engine, path = ENGINES[self.engine], Path(bpy.path.abspath(self.filepath))
        lightmaps = self.lightmaps if engine.has_options else engine.lightmaps
        use_files = self.use_files if engine.has_options else engine.use_files
        if self.properties.is_property_set("engine"):
            context.scene.hemibake.export_engine = self.engine
        try:
            made = export_for_engine(context, path, _KINDS[lightmaps], use_files, engine.for_godot)
        except EngineError as error:
            report_message(self, "ERROR", str(error))
            return {"CANCELLED"}
        for note in made.notes:
            report_message(self, "WARNING", note)
        self.report({"INFO"}, f"{counted(made.lit, 'object')} with lightmaps exported to '{path.name}'")
        return {"FINISHED"}


CLASSES = (HEMIBAKE_OT_export_for_engine,)
