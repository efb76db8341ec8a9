"""Lightmaps panel: the lightmaps of the scene, their objects, and operators on their UVs."""

from __future__ import annotations

import bpy

from ..engine.object_message import counted
from ..operators.lightmap_list import active_lightmap, counts, unlisted
from .sidebar import SubPanel
from .wrapped_text import draw_text, line_width

#: Fraction of a row that the name of a lightmap takes.
_NAME = 0.5


class HEMIBAKE_UL_lightmaps(bpy.types.UIList):
    """List of lightmaps: name, width in texels, number of objects, and fraction used by charts."""

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
        row = layout.split(factor=_NAME)
        row.label(text=item.name, icon="IMAGE_DATA" if item.image else "BLANK1")
        facts = row.row(align=True)
        for text in _figures(context.scene, item):
            facts.label(text=text)

    def filter_items(
        self, context: bpy.types.Context, data: bpy.types.PropertyGroup, name: str
    ) -> tuple[list[int], list[int]]:
        """Return the filter flags of the entries: maps of other outputs than Combined are hidden."""
        entries, shown = getattr(data, name), self.bitflag_filter_item
        found = [shown] * len(entries)
        if self.filter_name:
            found = bpy.types.UI_UL_list.filter_items_by_name(self.filter_name, shown, entries)
        return [0 if entry.companion_of else flag for entry, flag in zip(entries, found, strict=True)], []


class HEMIBAKE_PT_lightmaps(SubPanel, bpy.types.Panel):
    """List of lightmaps, with operators that assign objects and make lightmap UVs."""

    bl_label = "Lightmaps"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        row = layout.row()
        kept = scene.hemibake
        row.template_list("HEMIBAKE_UL_lightmaps", "", kept, "lightmaps", kept, "active_lightmap", rows=3)
        buttons = row.column(align=True)
        buttons.operator("hemibake.lightmap_add", text="", icon="ADD")
        buttons.operator("hemibake.lightmap_remove", text="", icon="REMOVE")
        for name in unlisted(scene):
            layout.label(text=f"{name}: {_counted(scene, name)}, not baked yet", icon="BLANK1")
        entry = active_lightmap(scene)
        if entry is not None:
            draw_text(layout, _facts(scene, entry), line_width(context))
        row = layout.row(align=True)
        row.operator("hemibake.lightmap_assign", text="Assign")
        row.operator("hemibake.lightmap_select", text="Select")
        row = layout.row(align=True)
        row.operator("hemibake.lightmap_repack", text="Repack")
        row.operator("hemibake.lightmap_unwrap", text="Unwrap Again")
        layout.operator("hemibake.unwrap", text="Unwrap Missing UVs", icon="UV")
        layout.operator("hemibake.export_for_engine", icon="EXPORT")


def _figures(scene: bpy.types.Scene, entry: bpy.types.PropertyGroup) -> tuple[str, str, str]:
    """Return width, number of objects and used fraction of a lightmap, as columns of the list."""
    width = str(entry.image.size[0]) if entry.image else "–"
    return width, str(sum(counts(scene, entry.name))), f"{entry.used:.0f}%" if entry.image else "–"


def _facts(scene: bpy.types.Scene, entry: bpy.types.PropertyGroup) -> str:
    """Return the image, size, objects, used fraction and further maps of a lightmap, in one line."""
    known = _counted(scene, entry.name)
    if entry.image is None:
        return f"{known}, not baked yet"
    width, height = entry.image.size
    facts = f"'{entry.image.name}': {width} x {height} texels, {known}, {entry.used:.0f}% used"
    beside = sum(other.companion_of == entry.name for other in scene.hemibake.lightmaps)
    return f"{facts}, with {counted(beside, 'map')} of other outputs" if beside else facts


def _counted(scene: bpy.types.Scene, name: str) -> str:
    """Return the numbers of objects and instances of a lightmap, such as "3 objects, 1 instance"."""
    objects, instances = counts(scene, name)
    parts = [counted(objects, "object")] if objects or not instances else []
    return ", ".join([*parts, counted(instances, "instance")] if instances else parts)


CLASSES = (HEMIBAKE_UL_lightmaps, HEMIBAKE_PT_lightmaps)
