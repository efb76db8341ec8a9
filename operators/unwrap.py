"""Unwrap operator: creates missing lightmap UVs, modal in a window and blocking elsewhere."""

from __future__ import annotations

from collections.abc import Generator, Sequence

import bpy

from ..engine.errors import EngineError
from ..engine.object_message import counted
from ..engine.progress import Progress, finished
from .bake_settings import read_settings
from .lightmap_size import choose_width
from .lookup import find_all
from .modal import ModalOperator
from .report_message import report_message
from .rollback import Rollback
from .scene import SceneContext, visible_meshes
from .scene.uvs.unwrap import UnwrapSummary, UvAction, unwrap_missing
from .window_bake import WindowBake
from .worker_manager import poll_idle


class Unwrapping:
    """Run that creates lightmap UVs of objects; `cancel` undoes it.

    Raises EngineError, with nothing changed, if a setting is out of its range.

    count  number of objects that were passed
    """

    def __init__(
        self,
        context: bpy.types.Context,
        objects: Sequence[bpy.types.Object],
        action: UvAction = UvAction.NONE,
    ) -> None:
        properties, self._context = context.scene.hemibake, SceneContext(context)
        read_settings(properties)
        self.count, self._changes = len(objects), Rollback()
        self._uv_layer, self._action = properties.uv_layer, action
        self._work = self._all_work([obj.session_uid for obj in objects])

    def _all_work(self, uids: Sequence[int]) -> Generator[Progress | None, None, UnwrapSummary]:
        """Choose the width of lightmaps for the whole scene, then unwrap objects by session uid."""
        context, changes = self._context, self._changes
        size = yield from choose_width(context, visible_meshes(context), changes)
        objects, movable = find_all(bpy.data.objects, uids), visible_meshes(context)
        made = yield from unwrap_missing(
            context, objects, self._uv_layer, size.width, changes, self._action, movable
        )
        made.notes = [*size.notes, *made.notes]
        return made

    def step(self) -> Progress | None:
        """Do a slice of work; raises StopIteration(UnwrapSummary) at the end."""
        return next(self._work)

    def run_to_end(self) -> UnwrapSummary:
        """Do all the work and return its result."""
        return finished(self._work)

    def cancel(self, keep_images: bool = False) -> bool:
        """Stop and undo all changes; return False, since nothing is kept."""
        try:
            self._work.close()
        finally:
            self._changes.undo()
        return False


class UnwrapOperator(ModalOperator):
    """Base class of operators that make lightmap UVs: modal in a window, blocking elsewhere."""

    cancelled = "Unwrapping cancelled"

    def _start(self, context: bpy.types.Context) -> Unwrapping:
        """Return the run to step; raises EngineError."""
        raise NotImplementedError

    def _tell(self, made: UnwrapSummary, count: int) -> set[str]:
        """Report the result to the user and return the operator's status; `count` objects were passed."""
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Unwrap and return after the end."""
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
        """Start unwrapping; `modal` continues it."""
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
        """Report the result; if no object was unwrapped, undo everything, also moves of other charts."""
        if not made.objects:
            run.cancel()
            made.moved, made.notes = [], made.issues
        return self._tell(made, run.count)

    def _failed(self, context: bpy.types.Context, error: EngineError) -> set[str]:
        self.cancel(context)
        return self._refuse(error)

    def _refuse(self, error: EngineError) -> set[str]:
        report_message(self, "ERROR", str(error))
        return {"CANCELLED"}


class HEMIBAKE_OT_unwrap(UnwrapOperator, bpy.types.Operator):
    """Create lightmap UVs for selected objects without them; without a selection, for all visible ones"""

    bl_idname = "hemibake.unwrap"
    bl_label = "Unwrap Missing Lightmap UVs"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_idle(cls)

    def _start(self, context: bpy.types.Context) -> Unwrapping:
        visible = visible_meshes(SceneContext(context))
        return Unwrapping(context, [obj for obj in visible if obj.select_get()] or visible)

    def _tell(self, made: UnwrapSummary, count: int) -> set[str]:
        """Report how many objects got new UVs, kept their UVs, or were moved in their lightmap."""
        for note in made.notes:
            report_message(self, "WARNING" if made.objects else "ERROR", note)
        if made.notes and not made.objects:
            return {"CANCELLED"}
        kept = count - len(made.objects) - len(made.skipped)
        done = counted(len(made.objects), "object")
        others = counted(len(made.moved), "other")
        moved = f"; {others} moved to make room. Bake again" if made.moved else ""
        self.report({"INFO"}, f"{done} unwrapped, {kept} had lightmap UVs or no faces{moved}")
        return {"FINISHED"} if made.objects else {"CANCELLED"}


CLASSES = (HEMIBAKE_OT_unwrap,)
