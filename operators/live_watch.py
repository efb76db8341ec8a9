"""Notices what changes in a scene while its lightmaps follow it."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from .handlers import Handlers
from .lookup import find
from .result.images import MARK as LIGHTMAP
from .result.preview import is_previewed, set_preview_aside
from .result.preview_material import MARK as PREVIEW
from .scene import SceneContext
from .scene.objects.render_depsgraph import reads_render

#: What decides how objects look.
_LOOKS = (bpy.types.Material, bpy.types.Image, bpy.types.Texture)

#: Changes of their members: objects that are added, deleted, shown or hidden.
_HOLDERS = (bpy.types.Scene, bpy.types.Collection)


class LiveWatch:
    """Watches a scene from `begin` to `end`; whoever reads what has changed clears it.

    Beside that it has files saved with what is shown: `saving` is called before, `saved` after that.

    lamps      True once lamps have changed, or were moved
    moved      session uids of objects that were moved
    objects    True once anything else has changed that the light may depend on
    materials  session uids of the materials that have
    undone     True once an undo has taken back that objects show their lightmaps
    """

    def __init__(
        self, context: SceneContext, saving: Callable[..., None], saved: Callable[..., None]
    ) -> None:
        self._context = context
        self.undone = self._showed = False
        self.clear()
        self._handlers = Handlers(
            {
                "depsgraph_update_post": self._note_update,
                "frame_change_post": self._note_update,
                "undo_pre": self._expect_undo,
                "undo_post": self._note_undo,
                "redo_pre": self._expect_undo,
                "redo_post": self._note_undo,
                "save_pre": saving,
                "save_post": saved,
            }
        )

    @property
    def changed(self) -> bool:
        """True once something has changed that the light may depend on."""
        return self.lamps or self.objects or bool(self.moved)

    def begin(self) -> None:
        """Listen to what changes from now on."""
        self._context.evaluated_depsgraph_get()
        self._handlers.begin()

    def end(self) -> None:
        """Listen no more."""
        self._handlers.end()

    def clear_moves(self) -> None:
        """Take the lamps, and where objects are, as they are."""
        self.lamps = False
        self.moved: set[int] = set()

    def clear(self) -> None:
        """Take the scene as it is."""
        self.clear_moves()
        self.objects = False
        self.materials: set[int] = set()

    def _note_update(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        if scene.session_uid != self._context.scene_uid or reads_render():
            return
        for update in depsgraph.updates:
            if _is_lamp(update.id):
                self.lamps = True
            elif _only_moves(update):
                self.moved.add(update.id.original.session_uid)
            elif _matters(update):
                self.objects = True
            if isinstance(update.id, bpy.types.Material):
                self.materials.add(update.id.original.session_uid)

    def _expect_undo(self, *_: object) -> None:
        """No step knows the preview materials that were made since the last one."""
        scene = find(bpy.data.scenes, self._context.scene_uid)
        if scene is not None:
            self._showed = is_previewed(scene)
            set_preview_aside(scene)

    def _note_undo(self, *_: object) -> None:
        """Objects tell whether they show their lightmaps: steps of Edit Mode bring no materials back."""
        scene = find(bpy.data.scenes, self._context.scene_uid)
        self.undone |= scene is None or (self._showed and not is_previewed(scene))
        self.objects, self.materials = True, {material.session_uid for material in bpy.data.materials}


def _is_lamp(item: bpy.types.ID) -> bool:
    return isinstance(item, bpy.types.Light) or getattr(item, "type", None) == "LIGHT"


def _only_moves(update: bpy.types.DepsgraphUpdate) -> bool:
    """Return True if an object was moved and is otherwise as it was."""
    others = update.is_updated_geometry or update.is_updated_shading
    return isinstance(update.id, bpy.types.Object) and update.is_updated_transform and not others


def _matters(update: bpy.types.DepsgraphUpdate) -> bool:
    """Return whether the light may depend on what was updated; new pixels of lightmaps are none of it."""
    if isinstance(update.id, _HOLDERS) or update.is_updated_geometry or update.is_updated_transform:
        return True
    if isinstance(update.id, bpy.types.World):
        return True
    own = update.id.get(LIGHTMAP) is not None or update.id.get(PREVIEW) is not None
    return update.is_updated_shading and isinstance(update.id, _LOOKS) and not own
