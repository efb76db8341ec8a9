"""Preview of the scene in the window, since scenes that share objects have separate lightmaps."""

from __future__ import annotations

from functools import partial

import bpy
from bpy.app.handlers import persistent

from .handlers import Handlers
from .lookup import find
from .result.preview import previewed, switch_preview


class _ShownScenes:
    """Scene that each window shows, by session uid."""

    def __init__(self) -> None:
        self._known: dict[int, int] | None = None

    def note(self, *_: object) -> None:
        """Switch the preview if a window has another scene than before."""
        manager = bpy.context.window_manager
        now = {window.as_pointer(): window.scene.session_uid for window in manager.windows}
        before, self._known = self._known, now
        changed = [now[key] for key in now if before is not None and before.get(key, now[key]) != now[key]]
        if not changed:
            return
        if bpy.app.background:
            _show(changed[-1])
        else:
            # Use a separate event, because handlers must not push undo steps.
            bpy.app.timers.register(partial(_show, changed[-1]), first_interval=0)

    def forget(self) -> None:
        """Drop the scenes, so that the next call of `note` switches nothing."""
        self._known = None


_shown = _ShownScenes()


def _show(scene_uid: int) -> None:
    """Switch the preview of a scene's objects to the lightmaps of this scene."""
    scene = find(bpy.data.scenes, scene_uid)
    windows = [window for window in bpy.context.window_manager.windows if window.scene == scene]
    if scene is None or not windows or not any(previewed(scene)):
        return
    with bpy.context.temp_override(window=windows[0]):
        switch_preview(scene, bpy.context.evaluated_depsgraph_get())
        if not bpy.app.background:
            # An undo frees preview materials that no undo step contains.
            bpy.ops.ed.undo_push(message="Lightmap Preview")


@persistent
def _note(*_: object) -> None:
    _shown.note()


@persistent
def _listen(*_: object) -> None:
    """Subscribe again after a file was loaded, because loading ends all subscriptions."""
    _shown.forget()
    _subscribe()
    _shown.note()


def _subscribe() -> None:
    """Let Blender call `note` when a user chooses a scene.

    Scripts that do so cause a depsgraph update instead.
    """
    bpy.msgbus.clear_by_owner(_shown)
    bpy.msgbus.subscribe_rna(key=(bpy.types.Window, "scene"), owner=_shown, args=(), notify=_note)


_handlers = Handlers({"depsgraph_update_post": _note, "load_post": _listen})


def bind() -> None:
    """Begin to follow the scenes of windows."""
    _handlers.begin()
    _subscribe()


def unbind() -> None:
    """End following the scenes of windows."""
    bpy.msgbus.clear_by_owner(_shown)
    _handlers.end()
    _shown.forget()
