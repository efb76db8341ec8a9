"""Light groups: which light is in which, and how the preview mixes their maps."""

from __future__ import annotations

import bpy

from ..operators.result.light_mixer import mixed_groups
from ..operators.result.preview import shows_preview
from .sidebar import SubPanel, split_properties
from .wrapped_text import draw_text, line_width

#: Part of a row that the name of a light group takes.
_NAME = 0.4


class HEMIBAKE_PT_light_groups(SubPanel, bpy.types.Panel):
    """Light groups of the view layer, those of the active object and the world, and the mixer."""

    bl_label = "Light Groups"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        settings = context.scene.hemibake
        return "light_groups" in settings.outputs or _has_maps(context.scene)

    def draw(self, context: bpy.types.Context) -> None:
        layout, view_layer = self.layout, context.view_layer
        for group in view_layer.lightgroups:
            layout.prop(group, "name", text="")
        row = layout.row(align=True)
        row.operator("scene.view_layer_add_lightgroup", text="Add", icon="ADD")
        row.operator("scene.view_layer_remove_unused_lightgroups", text="Remove Unused", icon="REMOVE")
        column = layout.column()
        split_properties(column)
        for owner in (context.object, context.scene.world):
            if owner is not None:
                column.prop_search(owner, "lightgroup", view_layer, "lightgroups", text=owner.name)
        if not _has_maps(context.scene):
            draw_text(layout, "A bake gives a map for each group", line_width(context), "INFO")
            return
        if context.scene.hemibake.light_mixer is not None:
            _draw_mixer(layout.column(), context.scene.hemibake.light_mixer)
        if not shows_preview(context.scene):
            draw_text(layout, "The preview mixes the maps of the groups", line_width(context), "INFO")


def _has_maps(scene: bpy.types.Scene) -> bool:
    """Return whether the last bake of a lightmap wrote maps of light groups, too."""
    return any(entry.light_groups not in ("", "[]") for entry in scene.hemibake.lightmaps)


def _draw_mixer(layout: bpy.types.UILayout, mixer: bpy.types.NodeTree) -> None:
    """Show colour and strength of each light group, which change the preview at once."""
    layout.label(text="Mixer")
    for name, color, strength in mixed_groups(mixer):
        row = layout.split(factor=_NAME)
        row.label(text=name)
        values = row.row(align=True)
        values.prop(color, "default_value", text="")
        values.prop(strength, "default_value", text="")


CLASSES = (HEMIBAKE_PT_light_groups,)
