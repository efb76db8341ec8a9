"""Export operator: writes the baked scene as a glTF file with its lightmaps."""

from __future__ import annotations

import os
from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from ..engine.errors import EngineError
from ..engine.object_message import counted
from .export_engines import ENGINES, Engine, engine_items
from .export_options import ExportOptions, PictureOptions
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
        name="Engine", description="Choose what the files are for", items=engine_items(), default="FILES"
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
        description="Choose the image format of the lightmaps in the glTF file (extension MOZ_lightmap)",
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

    picture_format: EnumProperty(
        name="Pictures",
        description="Choose the format of pictures of light and color",
        items=[("PNG", "PNG", "Write pictures without loss"), ("JPEG", "JPEG", "Write small pictures")],
    )
    picture_size: EnumProperty(
        name="Size",
        description="Choose the width of pictures of light and color",
        items=[
            ("0", "Lightmap", "Use the width of each lightmap"),
            ("512", "512", "Write 512 texels, for small objects and old phones"),
            ("1024", "1024", "Write 1024 texels, for Second Life and phones"),
            ("2048", "2048", "Write 2048 texels, for Second Life regions that allow them"),
            ("4096", "4096", "Write 4096 texels, the limit of Roblox"),
        ],
    )
    picture_exposure: FloatProperty(
        name="Exposure",
        description="Brighten pictures by this number of stops. White clips",
        soft_min=-10.0,
        soft_max=10.0,
        min=-60.0,
        max=60.0,
    )

    def check(self, context: bpy.types.Context) -> bool:
        """Set the ending of the file name to the format; return True if the name changed."""
        wanted = self.file_format if "file_format" in ENGINES[self.engine].options else ".glb"
        before: str = self.filepath
        folder, name = os.path.split(before)
        stem, ending = os.path.splitext(name)
        stem = stem if ending.lower() in (".glb", ".gltf") else name
        self.filepath: str = os.path.join(folder, stem + wanted) if name else before
        return self.filepath != before

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
        # Import Blender's glTF exporter only now, because it takes long to load.
        from .gltf.gltf_export import export_for_engine

        engine, path = ENGINES[self.engine], Path(bpy.path.abspath(self.filepath))
        if self.properties.is_property_set("engine"):
            context.scene.hemibake.export_engine = self.engine
        try:
            made = export_for_engine(context, path, self._options(engine))
        except EngineError as error:
            report_message(self, "ERROR", str(error))
            return {"CANCELLED"}
        for note in made.notes:
            report_message(self, "WARNING", note)
        self.report({"INFO"}, f"{counted(made.lit, 'object')} with lightmaps exported to '{path.name}'")
        return {"FINISHED"}

    def _options(self, engine: Engine) -> ExportOptions:
        """Return the options of an export for an engine."""
        pictures = None
        if engine.is_unlit:
            pictures = PictureOptions(
                f"image/{self.picture_format.lower()}", int(self.picture_size), self.picture_exposure
            )
        lightmaps = self.lightmaps if engine.is_custom else engine.lightmaps
        use_files = self.use_files if engine.is_custom else engine.use_files
        return ExportOptions(_KINDS[lightmaps], use_files, engine.for_godot, pictures, engine.for_unity)


CLASSES = (HEMIBAKE_OT_export_for_engine,)
