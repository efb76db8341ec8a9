"""Menu of presets."""

from __future__ import annotations

import bpy

from ..operators.presets import current_preset, preset_folders


class HEMIBAKE_MT_presets(bpy.types.Menu):
    """Presets of the bake settings."""

    bl_label = "Bake Presets"

    def draw(self, context: bpy.types.Context) -> None:
        self.path_menu(
            preset_folders(),
            "script.execute_preset",
            props_default={"menu_idname": type(self).__name__},
            filter_ext=lambda ending: ending == ".py",
        )


def draw_presets(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    """Draw the menu with the preset that the settings match, and buttons that add and remove presets."""
    current = current_preset(settings)
    row = layout.row(align=True)
    row.menu("HEMIBAKE_MT_presets", text=current.name if current else "Custom")
    row.operator("hemibake.preset_add", text="", icon="ADD")
    remove = row.row(align=True)
    remove.enabled = current is not None and not current.own
    removal = remove.operator("hemibake.preset_add", text="", icon="REMOVE")
    removal.name, removal.remove_name = current.name if current else "", True


CLASSES = (HEMIBAKE_MT_presets,)
