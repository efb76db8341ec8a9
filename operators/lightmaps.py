"""Operators on the lightmaps of a scene: which there are, which objects they hold, how they are packed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from ..engine.errors import EngineError
from ..engine.naming import counted, naming
from ..engine.progress import finished
from .bake_settings import read_settings
from .changes import Changes
from .lightmap_list import active_lightmap, members, unlisted
from .lightmap_size import chosen_width
from .scene import SceneContext
from .scene.uvs.unwrap import unwrap_missing
from .scene.uvs.uv_layers import set_layer_aside
from .scene.uvs.uv_modifier import drop_uv_modifier, uv_modifier
from .telling import tell
from .worker_owner import poll_idle

#: Name of a new lightmap.
_NAME = "Lightmap"


class _OfActiveLightmap:
    """What operators on the chosen lightmap have in common."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        chosen = active_lightmap(context.scene) is not None
        if not chosen:
            cls.poll_message_set("There is no lightmap in the list: add one, or bake")
        return chosen and poll_idle(cls)


class HEMIBAKE_OT_lightmap_add(bpy.types.Operator):
    """Add a lightmap to the list, without objects and not baked yet"""

    bl_idname = "hemibake.lightmap_add"
    bl_label = "Add Lightmap"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_idle(cls)

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.hemibake
        for name in unlisted(context.scene):
            settings.lightmaps.add().name = name
        taken = {entry.name for entry in settings.lightmaps}
        names = (_NAME if number == 0 else f"{_NAME}.{number:03d}" for number in range(10**6))
        settings.lightmaps.add().name = next(name for name in names if name not in taken)
        settings.active_lightmap = len(settings.lightmaps) - 1
        return {"FINISHED"}


class HEMIBAKE_OT_lightmap_remove(_OfActiveLightmap, bpy.types.Operator):
    """Remove the lightmap from the list; its image and file stay"""

    bl_idname = "hemibake.lightmap_remove"
    bl_label = "Remove Lightmap"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        entry = active_lightmap(context.scene)
        if entry is not None and members(context.scene, entry.name):
            cls.poll_message_set("The lightmap holds objects: assign them to another one first")
            return False
        return super().poll(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.hemibake
        settings.lightmaps.remove(settings.active_lightmap)
        settings.active_lightmap = max(0, min(settings.active_lightmap, len(settings.lightmaps) - 1))
        return {"FINISHED"}


class HEMIBAKE_OT_lightmap_assign(_OfActiveLightmap, bpy.types.Operator):
    """Assign the selected objects to the lightmap; the next bake finds room for them there"""

    bl_idname = "hemibake.lightmap_assign"
    bl_label = "Assign to Lightmap"

    def execute(self, context: bpy.types.Context) -> set[str]:
        name = active_lightmap(context.scene).name
        objects = [obj for obj in context.selected_objects if obj.type == "MESH" and obj.is_editable]
        if not objects:
            self.report({"ERROR"}, "No mesh object of this file is selected")
            return {"CANCELLED"}
        for obj in objects:
            obj.hemibake.atlas = name
        self.report({"INFO"}, f"{counted(len(objects), 'object')} assigned to '{name}'")
        return {"FINISHED"}


class HEMIBAKE_OT_lightmap_select(_OfActiveLightmap, bpy.types.Operator):
    """Select the objects of the lightmap"""

    bl_idname = "hemibake.lightmap_select"
    bl_label = "Select Objects of Lightmap"

    def execute(self, context: bpy.types.Context) -> set[str]:
        inside = set(members(context.scene, active_lightmap(context.scene).name))
        for obj in context.view_layer.objects:
            obj.select_set(obj in inside)
        return {"FINISHED"}


class HEMIBAKE_OT_lightmap_repack(_OfActiveLightmap, bpy.types.Operator):
    """Make new lightmap UVs for all objects of the lightmap, packed together, in place of those they have"""

    bl_idname = "hemibake.lightmap_repack"
    bl_label = "Repack Lightmap"

    def execute(self, context: bpy.types.Context) -> set[str]:
        changes, entry = Changes(), active_lightmap(context.scene)
        objects = [obj for obj in members(context.scene, entry.name) if obj.hemibake.atlas == entry.name]
        try:
            notes = _unwrap_anew(context, [obj for obj in objects if obj.is_editable], changes)
        except EngineError as error:
            changes.take_back()
            tell(self, "ERROR", str(error))
            return {"CANCELLED"}
        for note in notes:
            tell(self, "WARNING", note)
        self.report({"INFO"}, f"{counted(len(objects), 'object')} packed into '{entry.name}': bake again")
        return {"FINISHED"}


def _unwrap_anew(context: bpy.types.Context, objects: list[bpy.types.Object], changes: Changes) -> list[str]:
    """Replace the lightmap UVs of objects; raises EngineError if one of them cannot have new ones."""
    settings = context.scene.hemibake
    read_settings(settings)
    if not objects:
        raise EngineError("The lightmap holds no objects. Assign some to it.")
    resolution = chosen_width(SceneContext(context), objects, settings)
    chosen = [obj.name for obj in objects if obj.hemibake.own_uv_layer]
    if chosen:
        sentence = "The UV layers chosen for {} stay as they are. Clear their UV Layer to repack them."
        raise EngineError(naming(sentence, chosen))
    with _kept_alive(objects, settings.uv_layer):
        for obj in objects:
            if uv_modifier(obj, settings.uv_layer):
                drop_uv_modifier(obj, settings.uv_layer, changes)
            if obj.data.is_editable:
                set_layer_aside(obj, settings.uv_layer, changes)
        made = finished(
            unwrap_missing(SceneContext(context), objects, settings.uv_layer, resolution, changes)
        )
    if made.skipped:
        raise EngineError(" ".join(made.notes))
    return made.notes


@contextmanager
def _kept_alive(objects: list[bpy.types.Object], uv_layer: str) -> Iterator[None]:
    """Keep the node groups of modifiers that are dropped, so that they can be brought back."""
    modifiers = [modifier for obj in objects if (modifier := uv_modifier(obj, uv_layer))]
    groups = [modifier.node_group for modifier in modifiers]
    for group in groups:
        group.use_fake_user = True
    try:
        yield
    finally:
        for group in groups:
            group.use_fake_user = False


CLASSES = (
    HEMIBAKE_OT_lightmap_add,
    HEMIBAKE_OT_lightmap_remove,
    HEMIBAKE_OT_lightmap_assign,
    HEMIBAKE_OT_lightmap_select,
    HEMIBAKE_OT_lightmap_repack,
)
