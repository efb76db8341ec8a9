"""The Unwrap operator: lightmap UVs on request, modal in a window, blocking elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from ..engine.errors import EngineError
from ..engine.object_message import counted
from ..engine.progress import Progress, finished
from .bake_settings import read_settings
from .lightmap_size import chosen_width
from .modal import ModalOperator
from .report_message import report_message
from .rollback import Rollback
from .scene import SceneContext, visible_meshes
from .scene.uvs.unwrap import UnwrapSummary, UvAction, unwrap_missing
from .window_bake import WindowBake
from .worker_manager import poll_idle


class Unwrapping:
    """An unwrapping of objects; it can be taken back until it ends.

    Raises EngineError, with nothing changed, if a setting is out of its range.

    count  objects that are looked at
    """

    def __init__(
        self, context: bpy.types.Context, objects: Sequence[bpy.types.Object], anew: UvAction = UvAction.NONE
    ) -> None:
        properties, where = context.scene.hemibake, SceneContext(context)
        read_settings(properties)
        resolution = chosen_width(where, objects, properties)
        self.count, self._changes = len(objects), Rollback()
        self._work = unwrap_missing(
            where, objects, properties.uv_layer, resolution, self._changes, anew, visible_meshes(where)
        )

    def step(self) -> Progress | None:
        """Do a slice of work; raises StopIteration(Made) at the end."""
        return next(self._work)

    def run_to_end(self) -> UnwrapSummary:
        """Do all the work and return what was done."""
        return finished(self._work)

    def cancel(self, keep_images: bool = False) -> bool:
        """Stop it and leave everything as it was; there is nothing to keep."""
        try:
            self._work.close()
        finally:
            self._changes.undo()
        return False


class UnwrapOperator(ModalOperator):
    """What operators that make lightmap UVs have in common: modal in a window, blocking elsewhere."""

    cancelled = "Unwrapping cancelled"

    def _start(self, context: bpy.types.Context) -> Unwrapping:
        """Return the work; raises EngineError."""
        raise NotImplementedError

    def _tell(self, made: UnwrapSummary, count: int) -> set[str]:
        """Report what was done."""
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Unwrap and return when it is done."""
        try:
            run = self._start(context)
        except EngineError as error:
            return self._refuse(error)
        try:
            return self._end(run, run.run_to_end())
        except EngineError as error:
            run.cancel()
            return self._refuse(error)
        except BaseException:
            run.cancel()
            raise

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Start unwrapping; `modal` follows it."""
        try:
            self._window = WindowBake(context, self._start(context))
        except EngineError as error:
            return self._refuse(error)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def _ended(self, context: bpy.types.Context, value: UnwrapSummary) -> set[str]:
        self._window.leave()
        return self._end(self._window.run, value)

    def _end(self, run: Unwrapping, made: UnwrapSummary) -> set[str]:
        """Report what was done; without a result the charts of others go back to where they were, too."""
        if not made.objects:
            run.cancel()
            made.moved = []
        return self._tell(made, run.count)

    def _failed(self, context: bpy.types.Context, error: EngineError) -> set[str]:
        self.cancel(context)
        return self._refuse(error)

    def _refuse(self, error: EngineError) -> set[str]:
        report_message(self, "ERROR", str(error))
        return {"CANCELLED"}


class HEMIBAKE_OT_unwrap(UnwrapOperator, bpy.types.Operator):
    """Make lightmap UVs for the selected objects, or for all visible ones, that have none"""

    bl_idname = "hemibake.unwrap"
    bl_label = "Unwrap Lightmap UVs"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_idle(cls)

    def _start(self, context: bpy.types.Context) -> Unwrapping:
        visible = visible_meshes(SceneContext(context))
        return Unwrapping(context, [obj for obj in visible if obj.select_get()] or visible)

    def _tell(self, made: UnwrapSummary, count: int) -> set[str]:
        """Report what was done."""
        for note in made.notes:
            report_message(self, "ERROR" if made.skipped and not made.objects else "WARNING", note)
        kept = count - len(made.objects) - len(made.skipped)
        done = counted(len(made.objects), "object")
        others = counted(len(made.moved), "other")
        moved = f"; {others} moved to make room: bake again" if made.moved else ""
        self.report({"INFO"}, f"{done} unwrapped, {kept} had lightmap UVs or no faces{moved}")
        return {"FINISHED"} if made.objects else {"CANCELLED"}


CLASSES = (HEMIBAKE_OT_unwrap,)
