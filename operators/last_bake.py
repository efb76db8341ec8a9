"""Report of the last bake of a scene, stored with the scene, or the error of the last bake."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

import bpy

from ..engine.object_message import counted

#: Entries of a report that are listed as text in its copy, so that the JSON part leaves them out.
_SUMMED_UP = ("warnings", "objects_of_warnings", "fixes_of_warnings")


class LastFailure:
    """Error of the last bake in this session.

    It is kept in memory, because .blend files store reports but no errors.
    """

    def __init__(self) -> None:
        self._scene, self._text = 0, ""

    def keep(self, scene: bpy.types.Scene, text: str) -> None:
        """Store the error of a bake of a scene."""
        self._scene, self._text = scene.session_uid, text

    def forget(self) -> None:
        """Remove the error, because another bake has begun."""
        self._scene, self._text = 0, ""

    def of(self, scene: bpy.types.Scene) -> str:
        """Return the error of the last bake of a scene, empty if the bake did not fail."""
        return self._text if scene.session_uid == self._scene else ""


class ReportWarning(NamedTuple):
    """Warning of a report: its sentence, the names of its objects, and the name of its fix or ""."""

    text: str
    objects: list[str]
    fix: str


#: The only instance. It is a global, since Blender's data cannot hold Python objects.
last_failure = LastFailure()


def last_report(scene: bpy.types.Scene) -> dict[str, Any] | None:
    """Return the report of the last successful bake of a scene; None without one."""
    return json.loads(scene.hemibake.report) if scene.hemibake.report else None


def summary(report: dict[str, Any]) -> str:
    """Return objects, texels, bounces, convergence error and time of a bake, in one line."""
    instances = report.get("instances", 0)
    parts = [
        *([counted(report["objects"], "object")] if report["objects"] or not instances else []),
        *([counted(instances, "instance")] if instances else []),
        counted(report["patches"], "texel"),
        counted(report["iterations"], "bounce"),
    ]
    if report["convergence_error"] is not None:
        parts.append(f"convergence error {report['convergence_error']:.2%}")
    return ", ".join([*parts, f"{report['seconds']['total']:.1f} s"])


def energy_balance(report: dict[str, Any]) -> str:
    """Return the energy balance of a bake, in one line; empty if it is unknown or no light was emitted."""
    energy = report.get("energy") or {}
    if not energy.get("emitted") or None in energy.values():
        return ""
    emitted = energy["emitted"]
    absorbed, escaped, left = (
        _percent(energy[name] / emitted) for name in ("absorbed", "escaped", "not_bounced")
    )
    return (
        f"Light: {emitted:.3g} W emitted, {absorbed} absorbed, {escaped} left the scene, {left} not bounced "
        f"yet (balance error {abs(energy['missing']):.2%})"
    )


def vertex_error(report: dict[str, Any]) -> str:
    """Return the largest error of light at vertices, in one line; empty if no object has such light."""
    entries = report.get("vertex_light") or []
    if not entries:
        return ""
    worst = max(entries, key=lambda entry: entry["error"])
    return (
        f"Light at vertices: {counted(len(entries), 'object')}, error up to {worst['error']:.1%} of the mean "
        f"('{worst['object']}')"
    )


def _percent(fraction: float) -> str:
    """Return a fraction in percent, with 0 instead of -0."""
    return f"{round(fraction, 3) + 0.0:.1%}"


def report_warnings(report: dict[str, Any]) -> list[ReportWarning]:
    """Return the warnings of a report."""
    columns = report["warnings"], report["objects_of_warnings"], report["fixes_of_warnings"]
    return [ReportWarning(*facts) for facts in zip(*columns, strict=True)]


class HEMIBAKE_OT_copy_report(bpy.types.Operator):
    """Copy the report of the last bake to the clipboard: figures, times, devices and warnings"""

    bl_idname = "hemibake.copy_report"
    bl_label = "Copy Bake Report"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        has_report = bool(context.scene.hemibake.report or last_failure.of(context.scene))
        if not has_report:
            cls.poll_message_set("The scene has not been baked yet")
        return has_report

    def execute(self, context: bpy.types.Context) -> set[str]:
        context.window_manager.clipboard = _whole_text(context.scene)
        self.report({"INFO"}, "The report is in the clipboard")
        return {"FINISHED"}


def _whole_text(scene: bpy.types.Scene) -> str:
    """Return the error and the report of a scene as text for a bug report."""
    lines, failure, report = [f"Blender {bpy.app.version_string}"], last_failure.of(scene), last_report(scene)
    if failure:
        lines.append(f"The last bake failed: {failure}")
    if report:
        lines += [f"Baked {summary(report)}", *filter(None, [vertex_error(report)]), *report["warnings"]]
        facts = {name: value for name, value in report.items() if name not in _SUMMED_UP}
        lines.append(json.dumps(facts, indent=1))
    return "\n".join(lines) + "\n"


CLASSES = (HEMIBAKE_OT_copy_report,)
