"""Base classes of panels in the Hemibake tab of the 3D view's sidebar."""

from __future__ import annotations

import bpy


class Sidebar:
    """Location of a panel in the Hemibake tab."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Hemibake"


class SubPanel(Sidebar):
    """Location of a sub-panel of the Bake panel."""

    bl_parent_id = "HEMIBAKE_PT_bake"


def split_properties(layout: bpy.types.UILayout) -> None:
    """Draw labels of properties on the left and no keyframe buttons, as in Blender's own panels."""
    layout.use_property_split = True
    layout.use_property_decorate = False
