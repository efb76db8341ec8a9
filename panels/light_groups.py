"""Light Groups panel: groups of the view layer, group of the world, mixer of the maps, light states."""

from __future__ import annotations

import bpy

from ..operators.result.light_mixer import mixed_groups
from ..operators.result.light_states import active_state, baked_groups
from ..operators.result.preview import shows_preview
from .sidebar import SubPanel, split_properties
from .wrapped_text import draw_text, line_width

#: Fraction of a row that the name of a light group takes.
_NAME = 0.4

#: Meaning of an empty sun path, and of the list of light states while it is empty.
_SUN_PATH = "Times of day: a bake makes a light state of the sun at each"
_STATES = "A light state is a named mix of the groups. + adds the present mix"


class HEMIBAKE_UL_light_states(bpy.types.UIList):
    """List of light states, with editable names."""

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        data: bpy.types.PropertyGroup,
        item: bpy.types.PropertyGroup,
        icon: int,
        active_data: bpy.types.PropertyGroup,
        active_property: str,
        index: int = 0,
        flags: int = 0,
    ) -> None:
        layout.prop(item, "name", text="", emboss=False, icon="LIGHT")


class HEMIBAKE_PT_light_groups(SubPanel, bpy.types.Panel):
    """Light groups of the view layer and the world, mixer and states; shown only if light groups are baked.

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
        _draw_sun_path(layout.column(), context.scene.hemibake, line_width(context))
        _draw_maps(layout, context)


def _draw_sun_path(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup, width: float) -> None:
    """Draw the times of the sun path, and their meaning, or its place once there are times."""
    split_properties(layout)
    layout.prop(settings, "sun_times", placeholder="08:00 12:30")
    if not settings.sun_times:
        draw_text(layout, _SUN_PATH, width, "INFO")
    else:
        for name in ("sun_light", "sun_latitude", "sun_day", "sun_north"):
            layout.prop(settings, name)


def _draw_maps(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the mixer of the light groups' maps; without maps, draw how to get them."""
    scene, width = context.scene, line_width(context)
    if not _has_maps(scene):
        draw_text(layout, "Choose a group for objects under Active Object, then bake", width, "INFO")
        return
    if scene.hemibake.light_mixer is not None:
        _draw_mixer(layout.column(), scene.hemibake.light_mixer)
    if not shows_preview(scene):
        draw_text(layout, "Show Lightmaps to see the mix", width, "INFO")
    _draw_states(layout.column(), context)


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


def _draw_states(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the list of light states, the operators on the chosen one, and its groups."""
    kept, state = context.scene.hemibake, active_state(context.scene)
    layout.label(text="Light States")
    row = layout.row()
    row.template_list(
        "HEMIBAKE_UL_light_states", "", kept, "light_states", kept, "active_light_state", rows=3
    )
    buttons = row.column(align=True)
    buttons.operator("hemibake.light_state_add", text="", icon="ADD")
    buttons.operator("hemibake.light_state_remove", text="", icon="REMOVE")
    if state is None:
        draw_text(layout, _STATES, line_width(context), "INFO")
        return
    row = layout.row(align=True)
    row.operator("hemibake.light_state_apply", text="Apply").seconds = kept.light_fade
    row.operator("hemibake.light_state_store", text="Store Mix")
    row.operator("hemibake.light_state_write", text="Write Files")
    layout.prop(kept, "light_fade")
    known = baked_groups(context.scene)
    for group in state.groups:
        row = layout.split(factor=_NAME)
        row.label(text=group.name, icon="NONE" if group.name in known else "ERROR")
        values = row.row(align=True)
        values.prop(group, "color", text="")
        values.prop(group, "strength", text="")
    missing = [group.name for group in state.groups if group.name not in known]
    if missing:
        draw_text(
            layout,
            f"No maps of {', '.join(missing)}: bake the group or store again",
            line_width(context),
            "ERROR",
        )


CLASSES = (HEMIBAKE_UL_light_states, HEMIBAKE_PT_light_groups)
