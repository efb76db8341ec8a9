"""The Unwrap operator: lightmap UVs on request."""

from __future__ import annotations

import bpy

from ..engine.errors import EngineError
from ..engine.progress import finished
from .bake_settings import read_settings
from .changes import Changes
from .lightmap_size import chosen_width
from .scene import SceneContext, visible_meshes
from .scene.uvs.unwrap import unwrap_missing
from .telling import tell


class HEMIBAKE_OT_unwrap(bpy.types.Operator):
    """Make lightmap UVs for the selected objects, or for all visible ones, that have none"""

    bl_idname = "hemibake.unwrap"
    bl_label = "Unwrap Lightmap UVs"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        changes = Changes()
        properties = context.scene.hemibake
        visible = visible_meshes(context)
        objects = [obj for obj in visible if obj.select_get()] or visible
        try:
            read_settings(properties)
            where = SceneContext(context)
            resolution = chosen_width(where, objects, properties)
            work = unwrap_missing(where, objects, properties.uv_layer, resolution, changes)
            made = finished(work)
        except EngineError as error:
            changes.take_back()
            tell(self, "ERROR", str(error))
            return {"CANCELLED"}
        for note in made.notes:
            tell(self, "ERROR" if made.skipped and not made.objects else "WARNING", note)
        kept = len(objects) - len(made.objects) - len(made.skipped)
        self.report({"INFO"}, f"{len(made.objects)} objects unwrapped, {kept} had lightmap UVs or no faces")
        return {"FINISHED"} if made.objects else {"CANCELLED"}


CLASSES = (HEMIBAKE_OT_unwrap,)
