"""Operators on light states: add, remove, store the present mix, apply it, write its lightmaps."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import ClassVar

import bpy
from bpy.props import FloatProperty, StringProperty

from ..engine.errors import EngineError
from ..engine.object_message import counted
from .light_state_names import free_state_name
from .report_message import report_message
from .result.light_mixer import light_mixer, mixer_mix, set_mixer_mix
from .result.light_states import (
    UNCHANGED,
    Mix,
    active_state,
    baked_groups,
    find_state,
    missing_groups,
    set_state_mix,
    state_mix,
)
from .result.state_files import write_state
from .worker_manager import poll_idle

#: Name of a new state.
_NAME = "State"

#: Time between two steps of a fade, s.
_INTERVAL = 1 / 60


class _WithGroups:
    """Base class of operators that need maps of light groups."""

    poll_message_set: Callable[[str], None]

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not baked_groups(context.scene):
            cls.poll_message_set("The scene has no maps of light groups. Bake the output Light Groups first")
            return False
        return poll_idle(cls)


class _OfState(_WithGroups):
    """Base class of operators on one light state."""

    name: StringProperty(name="State", description="Name of the light state; empty for the chosen one")

    def _state(self, context: bpy.types.Context) -> bpy.types.PropertyGroup:
        """Return the light state of a name, or the active state; raises EngineError if there is none."""
        state = active_state(context.scene) if not self.name else find_state(context.scene, self.name)
        if state is None:
            raise EngineError(f"Scene '{context.scene.name}': the list has no light state. Add one.")
        return state

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            self._run(context, self._state(context))
        except EngineError as error:
            report_message(self, "ERROR", str(error))
            return {"CANCELLED"}
        return {"FINISHED"}

    def _run(self, context: bpy.types.Context, state: bpy.types.PropertyGroup) -> None:
        """Do the operator's work on the light state; raises EngineError."""
        raise NotImplementedError


class HEMIBAKE_OT_light_state_add(_WithGroups, bpy.types.Operator):
    """Add a light state with the present mix of the light groups"""

    bl_idname = "hemibake.light_state_add"
    bl_label = "Add Light State"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    name: StringProperty(name="Name", description="Name of the new light state", default=_NAME)

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.hemibake
        name = free_state_name(self.name, [state.name for state in settings.light_states])
        state = settings.light_states.add()
        state.name = name
        set_state_mix(state, _present_mix(context.scene))
        settings.active_light_state = len(settings.light_states) - 1
        return {"FINISHED"}


class HEMIBAKE_OT_light_state_remove(bpy.types.Operator):
    """Remove the light state from the list"""

    bl_idname = "hemibake.light_state_remove"
    bl_label = "Remove Light State"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return active_state(context.scene) is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.hemibake
        settings.light_states.remove(settings.active_light_state)
        settings.active_light_state = max(0, min(settings.active_light_state, len(settings.light_states) - 1))
        return {"FINISHED"}


class HEMIBAKE_OT_light_state_store(_OfState, bpy.types.Operator):
    """Replace the light state by the present mix of the light groups"""

    bl_idname = "hemibake.light_state_store"
    bl_label = "Store Light State"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    def _run(self, context: bpy.types.Context, state: bpy.types.PropertyGroup) -> None:
        set_state_mix(state, _present_mix(context.scene))


class HEMIBAKE_OT_light_state_apply(_OfState, bpy.types.Operator):
    """Show the light state: the mixer takes its colors and strengths, at once or by a fade"""

    bl_idname = "hemibake.light_state_apply"
    bl_label = "Apply Light State"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    seconds: FloatProperty(
        name="Fade", description="Duration of the fade in a window; 0 is at once", min=0.0, soft_max=10.0
    )

    #: The operator that fades now; it ends when another one starts.
    _fading: ClassVar[HEMIBAKE_OT_light_state_apply | None] = None

    def _run(self, context: bpy.types.Context, state: bpy.types.PropertyGroup) -> None:
        tree = _mixer(context.scene)
        set_mixer_mix(tree, _target(tree, state_mix(state)))
        self._tell_missing(context, state)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self.seconds <= 0 or context.window is None:
            return self.execute(context)
        try:
            state = self._state(context)
        except EngineError as error:
            report_message(self, "ERROR", str(error))
            return {"CANCELLED"}
        tree = _mixer(context.scene)
        self._before, self._after = mixer_mix(tree), _target(tree, state_mix(state))
        self._scene, self._start = context.scene.session_uid, time.perf_counter()
        self._timer = context.window_manager.event_timer_add(_INTERVAL, window=context.window)
        type(self)._fading = self
        self._tell_missing(context, state)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if type(self)._fading is not self or context.scene.session_uid != self._scene:
            self.cancel(context)
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS":
            set_mixer_mix(_mixer(context.scene), self._before)
            self.cancel(context)
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        part = min(1.0, (time.perf_counter() - self._start) / self.seconds)
        set_mixer_mix(_mixer(context.scene), faded(self._before, self._after, part))
        if part < 1:
            return {"PASS_THROUGH"}
        self.cancel(context)
        return {"FINISHED"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop the timer; Blender also calls this when a window closes or a file is loaded."""
        context.window_manager.event_timer_remove(self._timer)
        if type(self)._fading is self:
            type(self)._fading = None

    def _tell_missing(self, context: bpy.types.Context, state: bpy.types.PropertyGroup) -> None:
        """Report groups of a state that have no maps; the others are displayed."""
        for message in missing_groups(context.scene, state):
            report_message(self, "ERROR", message)


class HEMIBAKE_OT_light_state_write(_OfState, bpy.types.Operator):
    """Write the light state as plain lightmaps, in the folder and format of the bake"""

    bl_idname = "hemibake.light_state_write"
    bl_label = "Write Light State"
    bl_options = {"REGISTER", "INTERNAL"}

    def _run(self, context: bpy.types.Context, state: bpy.types.PropertyGroup) -> None:
        paths = write_state(context.scene, state)
        for message in missing_groups(context.scene, state):
            report_message(self, "WARNING", message)
        self.report(
            {"INFO"}, f"{counted(len(paths), 'file')} of '{state.name}' written to '{paths[0].parent}'"
        )


def faded(before: Mapping[str, Mix], after: Mapping[str, Mix], part: float) -> dict[str, Mix]:
    """Return the mix between two mixes with the same groups.

    part:  fraction of the way, exactly `after` at 1
    """
    mix = {}
    for name, (color, strength) in after.items():
        old_color, old_strength = before[name]
        red, green, blue = ((1 - part) * old + part * new for old, new in zip(old_color, color, strict=True))
        mix[name] = (red, green, blue), (1 - part) * old_strength + part * strength
    return mix


def _mixer(scene: bpy.types.Scene) -> bpy.types.NodeTree:
    """Return the mixer of a scene, created if the lightmaps have not been shown yet."""
    return scene.hemibake.light_mixer or light_mixer(scene, baked_groups(scene))


def _target(tree: bpy.types.NodeTree, mix: Mapping[str, Mix]) -> dict[str, Mix]:
    """Return the color and strength of each group of a mixer in a state."""
    return {name: mix.get(name, UNCHANGED) for name in mixer_mix(tree)}


def _present_mix(scene: bpy.types.Scene) -> dict[str, Mix]:
    """Return the mix that the preview shows; all groups unchanged if the lightmaps were never shown."""
    tree = scene.hemibake.light_mixer
    shown = {} if tree is None else mixer_mix(tree)
    return {name: shown.get(name, UNCHANGED) for name in baked_groups(scene)}


CLASSES = (
    HEMIBAKE_OT_light_state_add,
    HEMIBAKE_OT_light_state_remove,
    HEMIBAKE_OT_light_state_store,
    HEMIBAKE_OT_light_state_apply,
    HEMIBAKE_OT_light_state_write,
)
