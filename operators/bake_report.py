"""Report of a bake as a JSON-ready dictionary: objects, method, times, devices, files and warnings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict

from ..engine.bake_result import FluxBalance, Report
from ..engine.object_message import fix_of, objects_of
from .scene import ReadScene


def bake_report(
    read: ReadScene,
    facts: Report,
    lost: Mapping[int, str],
    seconds: Mapping[str, float],
    images: Sequence[str],
    files: Sequence[str],
    notes: Sequence[str],
    on_vertices: Sequence[dict],
) -> dict:
    """Return the report of a bake; the convergence error is None if a single iteration could not estimate it.

    facts    report of the engine
    lost     names by session uid of objects without a lightmap, because their UVs no longer exist
    seconds  wall time by stage
    images   names of the images
    files    paths of the files
    notes    sentences for the user; duplicates are removed
    on_vertices  "object", number of "values" and "error" of each object with light at its vertices
    """
    warnings = list(dict.fromkeys(notes))
    return {
        "objects": sum(entry.uid not in lost for entry in read.objects),
        "instances": sum(entry.name not in lost.values() for entry in read.instances),
        "triangles": read.triangles,
        "scene_bytes": read.bytes,
        "patches": int(facts.patches),
        "method": facts.method,
        "visibility": facts.visibility,
        "samples": facts.samples,
        "reasons": list(facts.reasons),
        "resumed": list(facts.resumed),
        "iterations": int(facts.iterations),
        "convergence_error": _number(facts.convergence_error),
        "converged": bool(facts.converged),
        "added_flux": [_number(energy) for energy in facts.added_flux],
        "energy": _energy(facts.energy),
        "seconds": {stage: round(float(value), 4) for stage, value in seconds.items()},
        "devices": dict(facts.devices),
        "images": list(images),
        "files": list(files),
        "vertex_light": list(on_vertices),
        "warnings": warnings,
        "objects_of_warnings": [objects_of(note) for note in warnings],
        "fixes_of_warnings": [fix_of(note) for note in warnings],
    }


def _number(value: float) -> float | None:
    """Return a number, or None if it is NaN or infinite, which JSON cannot store."""
    return float(value) if math.isfinite(value) else None


def _energy(energy: FluxBalance | None) -> dict[str, float | None] | None:
    """Return the flux balance as JSON, W, with the balance error as a fraction under "missing"."""
    if energy is None:
        return None
    return {name: _number(value) for name, value in {**asdict(energy), "missing": energy.missing}.items()}
