"""Operators on the list of lightmaps: add, remove, assign and select objects, pack and unwrap."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from ..engine.errors import EngineError
from ..engine.object_message import counted, object_message
from .lightmap_list import active_lightmap, chosen_name, members, unlisted
from .report_message import report_message
from .scene.uvs.known_charts import has_chosen_uvs
from .scene.uvs.unwrap import UnwrapSummary, UvAction
from .unwrap import UnwrapOperator, Unwrapping
from .worker_manager import poll_idle

#: Name of a new lightmap.
_NAME = "Lightmap"


class _OfActiveLightmap:
    """Base class of operators on the chosen lightmap of the list."""

    bl_options = {"REGISTER", "UNDO"}
    poll_message_set: Callable[[str], None]

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        chosen = active_lightmap(context.scene) is not None
        if not chosen:
            cls.poll_message_set("The list has no lightmap. Add one, or bake")
        return chosen and poll_idle(cls)


class HEMIBAKE_OT_lightmap_add(bpy.types.Operator):
    """Add an empty lightmap to the list"""

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
            cls.poll_message_set("The lightmap has objects. Assign them to another lightmap first")
            return False
        return super().poll(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.hemibake
        settings.lightmaps.remove(settings.active_lightmap)
        settings.active_lightmap = max(0, min(settings.active_lightmap, len(settings.lightmaps) - 1))
        return {"FINISHED"}


class HEMIBAKE_OT_lightmap_assign(_OfActiveLightmap, bpy.types.Operator):
    """Assign the selected objects to the lightmap. The next bake packs their charts into it"""

    bl_idname = "hemibake.lightmap_assign"
    bl_label = "Assign to Lightmap"

    def execute(self, context: bpy.types.Context) -> set[str]:
        name = chosen_name(context.scene)
        objects = [obj for obj in context.selected_objects if obj.type == "MESH" and obj.is_editable]
        if not objects:
            self.report({"ERROR"}, "No mesh object of this file is selected. Select some first")
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
        inside = set(members(context.scene, chosen_name(context.scene)))
        for obj in context.view_layer.objects:
            obj.select_set(obj in inside)
        return {"FINISHED"}


class _PackOperator(_OfActiveLightmap, UnwrapOperator):
    """Base class of operators that pack the chosen lightmap again."""

    _action: UvAction

    def _start(self, context: bpy.types.Context) -> Unwrapping:
        self._name = chosen_name(context.scene)
        objects = [obj for obj in members(context.scene, self._name) if obj.hemibake.atlas == self._name]
        objects = [obj for obj in objects if obj.is_editable]
        if not objects:
            raise EngineError(f"{self._name}: the lightmap has no objects. Assign some to it.")
        chosen = [obj.name for obj in objects if has_chosen_uvs(obj)]
        if chosen:
            sentence = (
                "{}: a UV layer of their own is chosen. Clear UV Layer under Active Object to repack them."
            )
            raise EngineError(object_message(sentence, chosen))
        return Unwrapping(context, objects, self._action)

    def _tell(self, made: UnwrapSummary, count: int) -> set[str]:
        for note in made.notes:
            report_message(self, "WARNING", note)
        if not made.objects:
            self.report({"INFO"}, f"'{self._name}' is already packed: nothing has changed")
            return {"CANCELLED"}
        done = counted(len(made.objects), "object")
        self.report({"INFO"}, f"{done} packed into '{self._name}'. Bake again")
        return {"FINISHED"}


class HEMIBAKE_OT_lightmap_repack(_PackOperator, bpy.types.Operator):
    """Pack the existing charts of all objects of the lightmap again. Needs a new bake"""

    bl_idname = "hemibake.lightmap_repack"
    bl_label = "Repack Lightmap"
    _action = UvAction.PACKING


class HEMIBAKE_OT_lightmap_unwrap(_PackOperator, bpy.types.Operator):
    """Replace the lightmap UVs of all objects of the lightmap by new charts. Needs a new bake"""

    bl_idname = "hemibake.lightmap_unwrap"
    bl_label = "Unwrap Lightmap Again"
    _action = UvAction.CHARTS


CLASSES = (
    HEMIBAKE_OT_lightmap_add,
    HEMIBAKE_OT_lightmap_remove,
    HEMIBAKE_OT_lightmap_assign,
    HEMIBAKE_OT_lightmap_select,
    HEMIBAKE_OT_lightmap_repack,
    HEMIBAKE_OT_lightmap_unwrap,
)
