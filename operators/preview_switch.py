"""Preview of the scene in the active window, since scenes that share objects have separate lightmaps.

Blender reports no activation of windows, so an item of the keymap follows the pointer into another window.
"""

from __future__ import annotations

from functools import partial

import bpy
from bpy.app.handlers import persistent

from .handlers import Handlers
from .lookup import find
from .result.preview import previewed, shows_other_scene, switch_preview


class _ShownScenes:
    """Scene that each window shows, by session uid.

    active:   scene of the window in which the pointer moves, by session uid; None before
    entered:  window with another scene in which the pointer moved last, as a pointer; 0 for none
    """

    def __init__(self) -> None:
        self._known: dict[int, int] | None = None
        self.active: int | None = None
        self.entered = 0

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
            _show_soon(changed[-1])

    def forget(self) -> None:
        """Drop the scenes, so that the next call of `note` switches nothing."""
        self._known = self.active = None


_shown = _ShownScenes()


class HEMIBAKE_OT_follow_window(bpy.types.Operator):
    """Show the lightmaps of the scene in this window on objects that show those of another scene"""

    bl_idname = "hemibake.follow_window"
    bl_label = "Show Lightmaps of the Active Window"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        # Every move of the pointer calls this, so that the common case comes first.
        return (
            len(context.window_manager.windows) > 1
            and context.scene is not None
            and context.scene.session_uid != _shown.active
        )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        window = context.window.as_pointer()
        if window != _shown.entered:
            # The window that the pointer leaves gets a last event too, so that one event means nothing.
            _shown.entered = window
            return {"PASS_THROUGH"}
        _shown.active, _shown.entered = context.scene.session_uid, 0
        if shows_other_scene(context.scene):
            _show_soon(context.scene.session_uid)
        return {"PASS_THROUGH"}


def follow_again() -> None:
    """Test the active window again at the next move of the pointer, since the preview has changed."""
    _shown.active = None


def _show_soon(scene_uid: int) -> None:
    """Switch the preview in an event of its own, because handlers and keymaps must not push undo steps."""
    bpy.app.timers.register(partial(_show, scene_uid), first_interval=0)


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


#: Keymap with the item that follows the pointer, and the item; None without a window.
_item: tuple[bpy.types.KeyMap, bpy.types.KeyMapItem] | None = None


def _add_item() -> None:
    """Call the operator when the pointer moves in a window."""
    global _item
    keys = bpy.context.window_manager.keyconfigs.addon
    if keys is not None:
        keymap = keys.keymaps.new(name="Window", space_type="EMPTY")
        operator = HEMIBAKE_OT_follow_window.bl_idname
        _item = keymap, keymap.keymap_items.new(operator, "MOUSEMOVE", "ANY", any=True)


def _remove_item() -> None:
    global _item
    if _item is not None:
        keymap, item = _item
        keymap.keymap_items.remove(item)
        _item = None


_handlers = Handlers({"depsgraph_update_post": _note, "load_post": _listen})


def bind() -> None:
    """Begin to follow the scenes of windows and the active window."""
    _handlers.begin()
    _subscribe()
    _add_item()


def unbind() -> None:
    """End following the scenes of windows and the active window."""
    _remove_item()
    bpy.msgbus.clear_by_owner(_shown)
    _handlers.end()
    _shown.forget()


CLASSES = (HEMIBAKE_OT_follow_window,)
