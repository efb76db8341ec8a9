"""Detection of scene changes while Live is running."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from .handlers import Handlers
from .lookup import find
from .original_slots import PREVIEW_MARK
from .result.images import MARK as LIGHTMAP
from .result.preview import is_previewed, set_preview_aside
from .result.probe_images import MARK as PROBES
from .scene import SceneContext
from .scene.objects.render_depsgraph import reads_render
from .scene.probe_volumes import is_probe_volume

#: Types of datablocks that affect the appearance of objects.
_LOOKS = (bpy.types.Material, bpy.types.Image, bpy.types.Texture)

#: Types of datablocks that Blender updates when objects are added, deleted, shown or hidden.
_HOLDERS = (bpy.types.Scene, bpy.types.Collection)


class LiveWatch:
    """Recorder of changes of a scene between `begin` and `end`; its reader must clear it.

    It also calls `saving` before and `saved` after each save of the file.

    lights      True if lights have changed or moved
    moved      session uids of objects that have moved
    objects    True if anything else has changed that affects light
    materials  session uids of changed materials
    undone     True if an undo has reverted showing the lightmaps
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
        """True if anything has changed that affects light."""
        return self.lamps or self.objects or bool(self.moved)

    def begin(self) -> None:
        """Start recording changes."""
        self._context.evaluated_depsgraph_get()
        self._handlers.begin()

    def end(self) -> None:
        """Stop recording changes."""
        self._handlers.end()

    def clear_moves(self) -> None:
        """Clear the recorded changes of lights and transforms."""
        self.lamps = False
        self.moved: set[int] = set()

    def clear(self) -> None:
        """Clear all recorded changes."""
        self.clear_moves()
        self.objects = False
        self.materials: set[int] = set()

    def _note_update(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        if scene.session_uid != self._context.scene_uid or reads_render():
            return
        for update in depsgraph.updates:
            if _is_lamp(update.id):
                self.lamps = True
            elif _only_moves(update) and not is_probe_volume(update.id):
                self.moved.add(update.id.original.session_uid)
            elif _matters(update):
                self.objects = True
            if isinstance(update.id, bpy.types.Material):
                self.materials.add(update.id.original.session_uid)

    def _expect_undo(self, *_: object) -> None:
        """Restore original materials before an undo, which would free the preview materials in use."""
        scene = find(bpy.data.scenes, self._context.scene_uid)
        if scene is not None:
            self._showed = is_previewed(scene)
            set_preview_aside(scene)

    def _note_undo(self, *_: object) -> None:
        """Detect an undo of showing the lightmaps. In Edit Mode an undo does not restore materials."""
        scene = find(bpy.data.scenes, self._context.scene_uid)
        self.undone |= scene is None or (self._showed and not is_previewed(scene))
        self.objects, self.materials = True, {material.session_uid for material in bpy.data.materials}


def _is_lamp(item: bpy.types.ID) -> bool:
    return isinstance(item, bpy.types.Light) or getattr(item, "type", None) == "LIGHT"


def _only_moves(update: bpy.types.DepsgraphUpdate) -> bool:
    """Return True if an update only changed the transform of an object."""
    others = update.is_updated_geometry or update.is_updated_shading
    return isinstance(update.id, bpy.types.Object) and update.is_updated_transform and not others


def _matters(update: bpy.types.DepsgraphUpdate) -> bool:
    """Return True if an update can change light; updated pixels of lightmaps cannot."""
    if isinstance(update.id, _HOLDERS) or update.is_updated_geometry or update.is_updated_transform:
        return True
    if isinstance(update.id, bpy.types.World):
        return True
    own = any(update.id.get(mark) is not None for mark in (LIGHTMAP, PROBES, PREVIEW_MARK))
    return update.is_updated_shading and isinstance(update.id, _LOOKS) and not own
