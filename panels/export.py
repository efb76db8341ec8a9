"""Panel of the file browser for *Export for Engine*: the engine, its add-on, and the options of files."""

from __future__ import annotations

import bpy

from ..operators.export_engines import ENGINES
from ..operators.preferences import guide_page
from .wrapped_text import draw_text, line_width

#: Identifier of the operator in the file browser.
_OPERATOR = "HEMIBAKE_OT_export_for_engine"


class HEMIBAKE_PT_export(bpy.types.Panel):
    """Options of Export for Engine."""

    bl_space_type = "FILE_BROWSER"
    bl_region_type = "TOOL_PROPS"
    bl_parent_id = "FILE_PT_operator"
    bl_label = ""
    bl_options = {"HIDE_HEADER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        operator = context.space_data.active_operator
        return operator is not None and operator.bl_idname == _OPERATOR

    def draw(self, context: bpy.types.Context) -> None:
        layout, operator = self.layout, context.space_data.active_operator
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.prop(operator, "engine")
        engine = ENGINES[operator.engine]
        for name in engine.options:
            layout.prop(operator, name)
        if engine.help:
            draw_text(layout, engine.help, line_width(context))
        page = guide_page(f"engines/{engine.page}") if engine.page else None
        if page is not None:
            layout.operator("wm.path_open", text="Open Steps", icon="HELP").filepath = str(page)
        if engine.folder is not None:
            button = layout.operator("wm.path_open", text="Open Add-on Folder", icon="FILE_FOLDER")
            button.filepath = str(engine.folder)


CLASSES = (HEMIBAKE_PT_export,)
