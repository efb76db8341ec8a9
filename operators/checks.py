"""The Check operator, and the operator that fixes a finding."""

from __future__ import annotations

import json
import time
from collections.abc import Collection

import bpy

from ..engine.errors import EngineError, SceneError
from ..engine.object_message import counted
from ..engine.progress import finished
from .check import Checked, check_scene, without_moved
from .check.fixes import FIXES
from .report_message import report_message
from .rollback import Rollback
from .scene import SceneContext
from .scene.slice_timer import Slices
from .scene.uvs.uv_node_group import remove_unused_uvs
from .worker_manager import poll_idle

#: Time that a check runs in a pause of other work, s.
_SLICE = 0.01


def last_check(scene: bpy.types.Scene) -> Checked | None:
    """Return the result of the last check of a scene; None if it was never checked."""
    return Checked.from_json(scene.hemibake.findings)


def keep_check(scene: bpy.types.Scene, checked: Checked) -> None:
    """Store the result of a check with its scene."""
    scene.hemibake.findings = checked.to_json()


def forget_moved_charts(scene: bpy.types.Scene, baked: Collection[str]) -> None:
    """Remove findings on moved charts of objects that were baked since from the scene's last check."""
    checked = last_check(scene)
    if checked is not None:
        keep_check(scene, without_moved(checked, baked))


class IdleCheck:
    """A check of a scene that runs in the pauses of its bake."""

    def __init__(self, context: SceneContext) -> None:
        self._context = context
        self._steps: Slices[Checked] | None = check_scene(context)

    def step(self) -> bool:
        """Continue the check for a short time, and store its result at the end; return whether it goes on.

        It also ends if the scene was deleted, which other code reports.
        """
        try:
            self._go_on()
        except SceneError:
            self._steps = None
        return self._steps is not None

    def _go_on(self) -> None:
        limit = time.perf_counter() + _SLICE
        while self._steps is not None and time.perf_counter() < limit:
            try:
                next(self._steps)
            except StopIteration as end:
                self._steps = None
                keep_check(self._context.scene, end.value)


class HEMIBAKE_OT_check(bpy.types.Operator):
    """Check the scene for problems, and estimate time and memory of a bake. Changes nothing"""

    bl_idname = "hemibake.check"
    bl_label = "Check Scene for Baking"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_idle(cls)

    def execute(self, context: bpy.types.Context) -> set[str]:
        checked = finished(check_scene(SceneContext(context)))
        keep_check(context.scene, checked)
        counts = dict.fromkeys(("ERROR", "WARNING", "INFO"), 0)
        for finding in checked.findings:
            counts[finding.severity] += 1
        words = zip(counts.values(), ("error", "warning", "note"), strict=True)
        found = ", ".join(counted(number, word) for number, word in words if number) or "Nothing"
        self.report({"INFO"}, f"{found} found: see Check in the sidebar")
        return {"FINISHED"}


class HEMIBAKE_OT_fix(bpy.types.Operator):
    """Fix the problem that the check found"""

    bl_idname = "hemibake.fix"
    bl_label = "Fix Finding"
    bl_options = {"UNDO", "INTERNAL"}

    fix: bpy.props.StringProperty(name="Fix", description="Name of the fix", options={"SKIP_SAVE"})
    names: bpy.props.StringProperty(
        name="Names", description="Names of the objects, as a JSON list", default="[]", options={"SKIP_SAVE"}
    )
    value: bpy.props.IntProperty(
        name="Value", description="Number that the fix uses, such as a resolution", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_idle(cls)

    @classmethod
    def description(cls, context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        """Return the first line of the fix's docstring as tool-tip, without full stop."""
        known = FIXES.get(properties.fix)
        return str(known[1].__doc__ if known else cls.__doc__).rstrip(".")

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene_objects, changes = context.scene.objects, Rollback()
        objects = [scene_objects[name] for name in json.loads(self.names) if name in scene_objects]
        try:
            FIXES[self.fix][1](context, objects, self.value, changes)
        except EngineError as error:
            changes.undo()
            report_message(self, "ERROR", str(error))
            return {"CANCELLED"}
        remove_unused_uvs()
        keep_check(context.scene, finished(check_scene(SceneContext(context))))
        return {"FINISHED"}


CLASSES = (HEMIBAKE_OT_check, HEMIBAKE_OT_fix)
