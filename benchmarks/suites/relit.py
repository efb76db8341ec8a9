"""Measures bakes after a change of light over the fraction of the visibility that is kept."""

from __future__ import annotations

import statistics
import time
from dataclasses import replace
from typing import Any

from benchmarks.configurations import settings
from benchmarks.halls import hall
from benchmarks.interiors import furnished_room
from benchmarks.launches import relit_scene
from benchmarks.options import Options
from benchmarks.tables import table
from engine import finished
from engine.quality import QUALITIES
from engine.session import Session

#: Fractions of the visibility data that *Cached Visibility* allows.
_FRACTIONS = (0.0, 0.25, 0.5, 0.75, 1.0)

#: Bakes of each fraction; an odd number, since the median counts.
_BAKES = 3

#: Bytes of light of back faces that a cache holds for each patch beside its samples, and more to be safe.
_BESIDE = 64


def run(options: Options) -> list[dict[str, Any]]:
    """Bake the hall, on a CPU a furnished room, and relight it with each fraction."""
    scene, resolution = (hall(2048), 2048) if options.gpu else (furnished_room(128), 128)
    chosen = settings(QUALITIES["high"].values, resolution=resolution)
    session, records = Session(), []
    brighter = relit_scene(scene)
    first = finished(session.bake(scene, chosen))
    for fraction in _FRACTIONS:
        size = _bytes(first.report.patches, first.report.samples)
        limited = replace(chosen, cache_budget=max(1, round(fraction * size)))
        session.forget()
        finished(session.bake(scene, limited))
        seconds = []
        for turn in range(_BAKES):
            began = time.perf_counter()
            lightmap = finished(session.bake((brighter, scene)[turn % 2], limited))
            seconds.append(time.perf_counter() - began)
        kept = next((text for text in lightmap.report.reasons if "kept" in text), "none")
        records.append(
            {"fraction": fraction, "seconds": statistics.median(seconds), "all": seconds, "kept": kept}
        )
    session.close()
    return records


def tables(records: list[dict[str, Any]], options: Options) -> str:
    """Return the times by the fraction that is allowed."""
    rows = [
        (f"{record['fraction']:.0%}", record["seconds"], f"{min(record['all']):.3g}–{max(record['all']):.3g}",
         record["kept"])
        for record in records
    ]  # fmt: skip
    return table(("kept", "relit, s", "spread, s", "report"), rows)


def _bytes(patches: int, samples: int) -> int:
    """Return the size of the visibility data, bytes; 4 for a sample of more than 65,534 patches."""
    return patches * ((4 if patches > (1 << 16) - 2 else 2) * samples + _BESIDE)
