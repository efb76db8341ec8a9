"""The preview follows the scene of the window: scenes that share objects have lightmaps of their own."""

from __future__ import annotations

from functools import partial

import bpy
from bpy.app.handlers import persistent

from .handlers import Handlers
from .lookup import find
from .result.preview import previewed, switch_preview


class _ShownScenes:
    """The scenes that windows show, by session uid."""

    def __init__(self) -> None:
        self._known: dict[int, int] | None = None

    def note(self, *_: object) -> None:
        """Let the preview follow a scene that is new to a window."""
        manager = bpy.context.window_manager
        now = {window.as_pointer(): window.scene.session_uid for window in manager.windows}
        before, self._known = self._known, now
        changed = [now[key] for key in now if before is not None and before.get(key, now[key]) != now[key]]
        if not changed:
            return
        if bpy.app.background:
            _show(changed[-1])
        else:
            # An event of its own: handlers must not push undo steps.
            bpy.app.timers.register(partial(_show, changed[-1]), first_interval=0)

    def forget(self) -> None:
        """Take what windows show next as it is."""
        self._known = None


_shown = _ShownScenes()


def _show(scene_uid: int) -> None:
    """Let the objects of a scene that show another scene's lightmaps show its own."""
    scene = find(bpy.data.scenes, scene_uid)
    windows = [window for window in bpy.context.window_manager.windows if window.scene == scene]
    if scene is None or not windows or not any(previewed(scene)):
        return
    with bpy.context.temp_override(window=windows[0]):
        switch_preview(scene, bpy.context.evaluated_depsgraph_get())
        if not bpy.app.background:
            # An undo frees preview materials that no step has.
            bpy.ops.ed.undo_push(message="Lightmap Preview")


@persistent
def _note(*_: object) -> None:
    _shown.note()


@persistent
def _listen(*_: object) -> None:
    """Take another file's windows as they are, and hear of their next scenes: loading a file ends that."""
    _shown.forget()
    _subscribe()
    _shown.note()


def _subscribe() -> None:
    """Have Blender call `_note` once a person chooses a scene; other ways update a depsgraph."""
    bpy.msgbus.clear_by_owner(_shown)
    bpy.msgbus.subscribe_rna(key=(bpy.types.Window, "scene"), owner=_shown, args=(), notify=_note)


_handlers = Handlers({"depsgraph_update_post": _note, "load_post": _listen})


def bind() -> None:
    """Follow the scenes of windows from now on."""
    _handlers.begin()
    _subscribe()


def unbind() -> None:
    """Follow them no more."""
    bpy.msgbus.clear_by_owner(_shown)
    _handlers.end()
    _shown.forget()
