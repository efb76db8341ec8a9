"""Preview of the scene in the active window, since scenes that share objects have separate lightmaps.

Blender reports no activation of windows, so an item of the keymap follows the pointer into another window.
The preview switches when the pointer has stayed there, and never during a bake or another modal operator.

A switch by the pointer pushes no undo step, which would end the redo history. Hence no undo step contains the
new preview materials, and an undo frees them even if objects use them. As in Live, original materials are
restored before an undo or redo, and the preview is shown again afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import bpy
from bpy.app.handlers import persistent

from .handlers import Handlers
from .lookup import find
from .result.preview import previewed, set_preview_aside, shows_other_scene, switch_preview
from .worker_manager import owner

#: Seconds that the pointer must stay in another window, so that crossing a window switches nothing (chosen).
_REST = 0.4

#: Seconds until the next attempt to switch during a bake or another modal operator (chosen).
_RETRY = 0.5


class _ShownScenes:
    """Scene that each window shows, by session uid.

    active:    scene of the window in which the pointer moves, by session uid; None before
    entered:   window with another scene in which the pointer moved last, as a pointer; 0 for none
    followed:  session uids of scenes with preview materials that may be in no undo step, in order
    """

    def __init__(self) -> None:
        self._known: dict[int, int] | None = None
        self.active: int | None = None
        self.entered = 0
        self.followed: list[int] = []

    def note(self, *_: object) -> None:
        """Switch the preview if a window has another scene than before."""
        manager = bpy.context.window_manager
        now = {window.as_pointer(): window.scene.session_uid for window in manager.windows}
        before, self._known = self._known, now
        changed = [now[key] for key in now if before is not None and before.get(key, now[key]) != now[key]]
        if not changed:
            return
        if bpy.app.background:
            _switch(changed[-1])
        else:
            _timer.start(partial(_show_chosen, changed[-1]))

    def forget(self) -> None:
        """Drop the scenes, so that the next call of `note` switches nothing."""
        self._known = self.active = None
        self.followed.clear()


class _Timer:
    """A call in an event of its own, because handlers and keymaps must not push undo steps.

    A new call replaces one that waits.
    """

    def __init__(self) -> None:
        self._call: Callable[[], float | None] | None = None

    def start(self, call: Callable[[], float | None], delay: float = 0.0) -> None:
        """Call a function after a delay in seconds, and again after the seconds that it returns."""
        self.stop()
        self._call = call
        bpy.app.timers.register(call, first_interval=delay)

    def stop(self) -> None:
        """Drop the waiting call. Loading a file has already removed it."""
        if self._call is not None and bpy.app.timers.is_registered(self._call):
            bpy.app.timers.unregister(self._call)
        self._call = None


_shown = _ShownScenes()
_timer = _Timer()


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
            and not owner.busy
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
            _timer.start(partial(_show_followed, _shown.active), _REST)
        return {"PASS_THROUGH"}


def follow_again() -> None:
    """Test the active window again at the next move of the pointer, since the preview has changed.

    An undo step must contain the changed preview.
    """
    _shown.active = None
    _shown.followed.clear()


def _show_chosen(scene_uid: int) -> float | None:
    """Show the lightmaps of a scene that the user has chosen; return the seconds until the next attempt."""
    if _is_modal():
        return _RETRY
    if _switch(scene_uid):
        # An undo frees preview materials that no undo step contains.
        bpy.ops.ed.undo_push(message="Lightmap Preview")
        _shown.followed.clear()
    return None


def _show_followed(scene_uid: int) -> float | None:
    """Show the lightmaps of the scene under the pointer; return the seconds until the next attempt."""
    if scene_uid != _shown.active:
        return None
    if owner.busy or _is_modal():
        return _RETRY
    if _switch(scene_uid):
        _shown.followed = [uid for uid in _shown.followed if uid != scene_uid] + [scene_uid]
    return None


def _is_modal() -> bool:
    """Return True if an operator of Blender or another add-on is modal, such as a move of objects."""
    windows = bpy.context.window_manager.windows
    running = (operator.bl_idname for window in windows for operator in window.modal_operators)
    return any(not name.startswith("HEMIBAKE_OT_") for name in running)


def _switch(scene_uid: int) -> bool:
    """Switch the preview of a scene's objects to the lightmaps of this scene; return True if any changed."""
    scene = find(bpy.data.scenes, scene_uid)
    windows = [window for window in bpy.context.window_manager.windows if window.scene == scene]
    if scene is None or not windows or not any(previewed(scene)):
        return False
    with bpy.context.temp_override(window=windows[0]):
        return switch_preview(scene, bpy.context.evaluated_depsgraph_get())


@persistent
def _expect_undo(*_: object) -> None:
    """Restore original materials before an undo, which would free the preview materials in use."""
    for uid in _shown.followed:
        scene = find(bpy.data.scenes, uid)
        if scene is not None:
            set_preview_aside(scene)


@persistent
def _note_undo(*_: object) -> None:
    """Show the preview again after an undo, and test the active window again."""
    if _shown.followed:
        _shown.active = None
        _timer.start(_show_again)


def _show_again() -> None:
    """Show the preview that was set aside."""
    for uid in _shown.followed:
        _switch(uid)


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


_handlers = Handlers(
    {
        "depsgraph_update_post": _note,
        "load_post": _listen,
        "undo_pre": _expect_undo,
        "undo_post": _note_undo,
        "redo_pre": _expect_undo,
        "redo_post": _note_undo,
    }
)


def bind() -> None:
    """Begin to follow the scenes of windows and the active window."""
    _handlers.begin()
    _subscribe()
    _add_item()


def unbind() -> None:
    """End following the scenes of windows and the active window."""
    _remove_item()
    _timer.stop()
    bpy.msgbus.clear_by_owner(_shown)
    _handlers.end()
    _shown.forget()


CLASSES = (HEMIBAKE_OT_follow_window,)
