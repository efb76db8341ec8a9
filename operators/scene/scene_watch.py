"""Detects changes of a scene while it is read."""

from __future__ import annotations

from collections.abc import Callable, Collection
from types import TracebackType
from typing import Self, TypeVar

import bpy

from ..handlers import Handlers
from .objects.evaluation import Evaluation, evaluate
from .objects.render_depsgraph import reads_render
from .objects.visible import visible_objects
from .scene_context import SceneContext

Made = TypeVar("Made")

#: Datablocks whose updates concern only members and settings. The list of visible objects shows whether these
#: matter.
_HOLDERS = (bpy.types.Scene, bpy.types.Collection)

#: Datablocks that determine the look of surfaces and light. Blender also tags objects whenever such a
#: datablock is created.
_LOOKS = (bpy.types.Material, bpy.types.World, bpy.types.Light, bpy.types.Image, bpy.types.Texture)


class SceneChangedError(Exception):
    """Raised if the scene changed since parts of it were read, so that it must be read again."""


class SceneWatch:
    """Watches a scene inside `with`.

    context:  the context of the scene
    visible:  session uids of the visible objects
    items:    number of objects and instances in the dependency graph
    """

    def __init__(self, context: SceneContext, tolerant: bool = False) -> None:
        """Watch the scene of a context; `tolerant`: True to accept all changes."""
        self.context, self._tolerant = context, tolerant
        self._changed = self._doubtful = False
        self._handlers = Handlers(
            {
                "depsgraph_update_post": self._note_update,
                "frame_change_post": self._note_update,
                "undo_post": self._note_undo,
                "redo_post": self._note_undo,
            }
        )
        self.visible, self.items = frozenset[int](), 0
        self._overrides: tuple[int, ...] = ()

    def __enter__(self) -> Self:
        self.accept()
        self.visible, self.items = self._census()
        self._overrides = self._find_overrides()
        self._handlers.begin()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._handlers.end()

    def depsgraph(self) -> bpy.types.Depsgraph:
        """Return the updated dependency graph; raises SceneChangedError if the scene changed."""
        depsgraph = self.context.evaluated_depsgraph_get()
        if self._doubtful:
            self._changed |= self._census() != (self.visible, self.items)
            self._changed |= self._find_overrides() != self._overrides
            self._doubtful = False
        if self._changed and not self._tolerant:
            raise SceneChangedError
        return depsgraph

    def evaluate(
        self,
        job: Callable[[Evaluation], Made],
        only: Collection[bpy.types.Object] | None = None,
        render: bool = False,
    ) -> Made:
        """Call a function with the evaluated objects of a bake, see `evaluate`; return its result.

        Raises SceneChangedError if the scene changed.
        """
        self.depsgraph()
        return evaluate(self.context, job, only, render)

    def accept(self) -> None:
        """Accept the present state of the scene as unchanged, after Hemibake itself has changed it."""
        self.context.evaluated_depsgraph_get()
        self._changed = self._doubtful = False

    def _census(self) -> tuple[frozenset[int], int]:
        """Return the session uids of the visible objects, and the number of objects and instances."""
        shown = frozenset(obj.session_uid for obj in visible_objects(self.context))
        return shown, len(self.context.view_layer.depsgraph.object_instances)

    def _find_overrides(self) -> tuple[int, ...]:
        """Return the session uids of the view layer's material override and of the world; 0 for none."""
        chosen = self.context.material_override, self.context.world
        return tuple(0 if item is None else item.session_uid for item in chosen)

    def _note_update(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        if scene.session_uid != self.context.scene_uid or reads_render():
            return
        for update in depsgraph.updates:
            moved = update.is_updated_geometry or update.is_updated_transform
            if isinstance(update.id, _HOLDERS):
                self._doubtful = True
            elif moved or (update.is_updated_shading and isinstance(update.id, _LOOKS)):
                self._changed = True

    def _note_undo(self, *_: object) -> None:
        self._changed = True
