"""What the last bake of a scene told: its report, kept with the scene, or why it failed."""

from __future__ import annotations

import json
from typing import Any

import bpy

from ..engine.object_message import counted

#: Figures of a report that its copy leaves to the line that sums them up.
_SUMMED_UP = ("warnings", "objects_of_warnings", "fixes_of_warnings")


class LastFailure:
    """Why the last bake of this session failed: a .blend keeps reports, but no failures."""

    def __init__(self) -> None:
        self._scene, self._text = 0, ""

    def keep(self, scene: bpy.types.Scene, text: str) -> None:
        """Keep why a bake of a scene failed."""
        self._scene, self._text = scene.session_uid, text

    def forget(self) -> None:
        """Keep nothing: another bake has begun."""
        self._scene, self._text = 0, ""

    def of(self, scene: bpy.types.Scene) -> str:
        """Return why the last bake of a scene failed, empty if it did not."""
        return self._text if scene.session_uid == self._scene else ""


#: One for the whole add-on, since Blender keeps no Python objects.
last_failure = LastFailure()


def last_report(scene: bpy.types.Scene) -> dict[str, Any] | None:
    """Return the report of the last bake of a scene that did not fail; None without one."""
    return json.loads(scene.hemibake.report) if scene.hemibake.report else None


def summary(report: dict[str, Any]) -> str:
    """Return what a bake did, in one line."""
    instances = report.get("instances", 0)
    parts = [
        *([counted(report["objects"], "object")] if report["objects"] or not instances else []),
        *([counted(instances, "instance")] if instances else []),
        counted(report["patches"], "patch", "es"),
        counted(report["iterations"], "bounce"),
    ]
    if report["convergence_error"] is not None:
        parts.append(f"remaining error {report['convergence_error']:.2%}")
    return ", ".join([*parts, f"{report['seconds']['total']:.1f} s"])


def energy_balance(report: dict[str, Any]) -> str:
    """Return where the light of a bake went, in one line; empty if that is not known, or in the dark."""
    energy = report.get("energy") or {}
    if not energy.get("emitted") or None in energy.values():
        return ""
    emitted = energy["emitted"]
    parts = [
        f"{_percent(energy[name] / emitted)} {name.replace('_', ' ')}"
        for name in ("absorbed", "escaped", "not_bounced")
    ]
    return f"Energy: {emitted:.3g} W = {' + '.join(parts)}, off by {abs(energy['missing']):.2%}"


def _percent(part: float) -> str:
    """Return a part in percent; none of it has no sign."""
    return f"{round(part, 3) + 0.0:.1%}"


def warnings_with_objects(report: dict[str, Any]) -> list[tuple[str, list[str], str]]:
    """Return the warnings of a report, each with the names of the objects that it is about, and its fix."""
    warnings = report["warnings"]
    nothing = [[]] * len(warnings), [""] * len(warnings)
    names, fixes = (
        report.get(kept, none)
        for kept, none in zip(("objects_of_warnings", "fixes_of_warnings"), nothing, strict=True)
    )
    return list(zip(warnings, names, fixes, strict=True))


class HEMIBAKE_OT_copy_report(bpy.types.Operator):
    """Copy what the last bake told to the clipboard: figures, times, devices and warnings"""

    bl_idname = "hemibake.copy_report"
    bl_label = "Copy Bake Report"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        told = bool(context.scene.hemibake.report or last_failure.of(context.scene))
        if not told:
            cls.poll_message_set("Nothing has been baked in the scene")
        return told

    def execute(self, context: bpy.types.Context) -> set[str]:
        context.window_manager.clipboard = _whole_text(context.scene)
        self.report({"INFO"}, "The report is in the clipboard")
        return {"FINISHED"}


def _whole_text(scene: bpy.types.Scene) -> str:
    """Return the failure and the report of a scene for somebody who is to help."""
    lines, failure, report = [f"Blender {bpy.app.version_string}"], last_failure.of(scene), last_report(scene)
    if failure:
        lines.append(f"The last bake failed: {failure}")
    if report:
        lines += [f"Baked {summary(report)}", *report["warnings"]]
        facts = {name: value for name, value in report.items() if name not in _SUMMED_UP}
        lines.append(json.dumps(facts, indent=1))
    return "\n".join(lines) + "\n"


CLASSES = (HEMIBAKE_OT_copy_report,)
