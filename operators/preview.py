"""Show Lightmaps operator: toggles between lightmaps and original materials."""

from __future__ import annotations

import bpy

from .result.moved_charts import warn_changed_uvs
from .result.preview import (
    has_preview,
    hide_preview,
    previewed,
    show_preview,
    shows_other_scene,
    switch_preview,
)
from .scene import SceneContext
from .viewports import show_materials, show_solid_again


class HEMIBAKE_OT_preview(bpy.types.Operator):
    """Show baked objects with the lightmaps of this scene, or with their original materials again"""

    bl_idname = "hemibake.preview"
    bl_label = "Show Lightmaps"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        if shows_other_scene(context.scene):
            switch_preview(context.scene, context.evaluated_depsgraph_get())
            self.report({"INFO"}, f"Objects show the lightmaps of scene '{context.scene.name}'")
            return {"FINISHED"}
        shown = list(previewed(context.scene))
        if shown:
            hide_preview(shown)
            show_solid_again()
            self.report({"INFO"}, f"{len(shown)} objects have their original materials again")
            return {"FINISHED"}
        count, notes = show_preview(context.scene, context.evaluated_depsgraph_get())
        if not count:
            self.report({"ERROR"}, " ".join(notes) or "No object has a lightmap to show. Bake first.")
            return {"CANCELLED"}
        for note in (*notes, *warn_changed_uvs(list(previewed(context.scene)), SceneContext(context))):
            self.report({"WARNING"}, note)
        show_materials(context)
        self.report({"INFO"}, f"{count} objects show their lightmaps")
        return {"FINISHED"}


def restore_materials() -> None:
    """Give all objects of the file their original materials, before the add-on that could do so is gone."""
    shown = [obj for obj in bpy.data.objects if has_preview(obj)]
    if shown:
        hide_preview(shown)
        show_solid_again()


CLASSES = (HEMIBAKE_OT_preview,)
