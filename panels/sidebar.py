"""The Hemibake tab in the sidebar of the 3D view."""

from __future__ import annotations

import bpy


class Sidebar:
    """Where a panel of the tab is."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Hemibake"


class SubPanel(Sidebar):
    """Where a panel below the panel Bake is."""

    bl_parent_id = "HEMIBAKE_PT_bake"


def split_properties(layout: bpy.types.UILayout) -> None:
    """Lay out properties as Blender's own panels do: names to the left, no buttons for keyframes."""
    layout.use_property_split = True
    layout.use_property_decorate = False
