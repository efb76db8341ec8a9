"""Entries of Hemibake's operators in Blender's menus, so that the menu search finds them."""

from __future__ import annotations

import bpy


class HEMIBAKE_MT_lightmaps(bpy.types.Menu):
    """Operators on the lightmaps of the scene."""

    bl_label = "Lightmaps"

    def draw(self, context: bpy.types.Context) -> None:
        for group in _GROUPS:
            for name in group:
                self.layout.operator(name)
            self.layout.separator()


#: Operators of the menu in groups; a separator follows each group.
_GROUPS = (
    ("hemibake.check", "hemibake.bake", "hemibake.cancel", "hemibake.preview", "hemibake.live"),
    ("hemibake.export_for_engine",),
    ("hemibake.unwrap", "hemibake.lightmap_repack", "hemibake.lightmap_unwrap", "hemibake.choose_resolution"),
    ("hemibake.apply_on_copy", "hemibake.remove_uv_modifiers"),
    (
        "hemibake.lightmap_add",
        "hemibake.lightmap_remove",
        "hemibake.lightmap_assign",
        "hemibake.lightmap_select",
    ),
    ("hemibake.add_light_probes",),
    ("hemibake.show_light_probes",),
    ("hemibake.copy_report",),
)


def _draw_object_menu(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    """Add the Lightmaps menu to the Object menu of the 3D view."""
    menu.layout.separator()
    menu.layout.menu("HEMIBAKE_MT_lightmaps")


def _draw_export_menu(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    """Add the export to File > Export."""
    menu.layout.operator("hemibake.export_for_engine", text="Lightmaps for Engine (.glb/.gltf)")


def _draw_help_menu(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    """Add the self-test to the Help menu."""
    menu.layout.operator("hemibake.self_test")


CLASSES = (HEMIBAKE_MT_lightmaps,)

_ENTRIES = (
    ("VIEW3D_MT_object", _draw_object_menu),
    ("TOPBAR_MT_file_export", _draw_export_menu),
    ("TOPBAR_MT_help", _draw_help_menu),
)


def bind() -> None:
    """Add the entries to Blender's menus."""
    for menu, entry in _ENTRIES:
        getattr(bpy.types, menu).append(entry)


def unbind() -> None:
    """Remove the entries."""
    for menu, entry in _ENTRIES:
        getattr(bpy.types, menu).remove(entry)
