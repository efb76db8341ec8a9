"""Light Groups panel: the groups of the view layer, the group of the world, and the mixer of their maps."""

from __future__ import annotations

import bpy

from ..operators.result.light_mixer import mixed_groups
from ..operators.result.preview import shows_preview
from .sidebar import SubPanel, split_properties
from .wrapped_text import draw_text, line_width

#: Fraction of a row that the name of a light group takes.
_NAME = 0.4


class HEMIBAKE_PT_light_groups(SubPanel, bpy.types.Panel):
    """Light groups of the view layer and the world, and the mixer; shown only if light groups are baked.

    The light group of an object is chosen in the Active Object panel.
    """

    bl_label = "Light Groups"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        settings = context.scene.hemibake
        return "light_groups" in settings.outputs or _has_maps(context.scene)

    def draw(self, context: bpy.types.Context) -> None:
        layout, view_layer, world = self.layout, context.view_layer, context.scene.world
        for group in view_layer.lightgroups:
            layout.prop(group, "name", text="")
        row = layout.row(align=True)
        row.operator("scene.view_layer_add_lightgroup", text="Add", icon="ADD")
        row.operator("scene.view_layer_remove_unused_lightgroups", text="Remove Unused", icon="REMOVE")
        if world is not None:
            column = layout.column()
            split_properties(column)
            column.prop_search(world, "lightgroup", view_layer, "lightgroups", text="World")
        _draw_maps(layout, context)


def _draw_maps(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the mixer of the maps of light groups, or how to get maps and see their mix."""
    scene, width = context.scene, line_width(context)
    if not _has_maps(scene):
        draw_text(layout, "Choose a group for objects under Active Object, then bake", width, "INFO")
        return
    if scene.hemibake.light_mixer is not None:
        _draw_mixer(layout.column(), scene.hemibake.light_mixer)
    if not shows_preview(scene):
        draw_text(layout, "Show Lightmaps to see the mix", width, "INFO")


def _has_maps(scene: bpy.types.Scene) -> bool:
    """Return True if the last bake of a lightmap wrote maps of light groups."""
    return any(entry.light_groups not in ("", "[]") for entry in scene.hemibake.lightmaps)


def _draw_mixer(layout: bpy.types.UILayout, mixer: bpy.types.NodeTree) -> None:
    """Draw color and strength of each light group, which change the shown lightmaps immediately."""
    layout.label(text="Mixer")
    for name, color, strength in mixed_groups(mixer):
        row = layout.split(factor=_NAME)
        row.label(text=name)
        values = row.row(align=True)
        values.prop(color, "default_value", text="")
        values.prop(strength, "default_value", text="")


CLASSES = (HEMIBAKE_PT_light_groups,)
