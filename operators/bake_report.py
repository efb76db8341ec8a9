"""The report of a bake, JSON-ready: what was baked, how, how long it took, and what to look at."""

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
) -> dict:
    """Return the report of a bake; the convergence error is None if a single iteration could not tell it.

    facts   what the engine tells
    lost    session uids and names of objects that have no lightmap, since their UVs are gone
    notes   sentences for the user; each is told once
    """
    warnings = list(dict.fromkeys(notes))
    return {
        "objects": sum(uid not in lost for uid, _ in read.objects),
        "instances": sum(name not in lost.values() for _, name, *_ in read.instances),
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
        "warnings": warnings,
        "objects_of_warnings": [objects_of(note) for note in warnings],
        "fixes_of_warnings": [fix_of(note) for note in warnings],
    }


def _number(value: float) -> float | None:
    """Return a number as JSON takes it: None if it is NaN or infinite."""
    return float(value) if math.isfinite(value) else None


def _energy(energy: FluxBalance | None) -> dict[str, float | None] | None:
    """Return where the light of a bake goes as JSON takes it: W, and what is missing as a fraction."""
    if energy is None:
        return None
    return {name: _number(value) for name, value in {**asdict(energy), "missing": energy.missing}.items()}
