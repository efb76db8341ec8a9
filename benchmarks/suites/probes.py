"""Measures light probes: the first bake of a volume, and a bake after a change of light."""

from __future__ import annotations

import statistics
import time
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.configurations import settings
from benchmarks.launches import relit_scene
from benchmarks.options import Options
from benchmarks.rooms import ROOM, cornell_box
from benchmarks.tables import table
from engine import Scene, finished
from engine.quality import QUALITIES
from engine.scene.probe_volume import ProbeVolume
from engine.session import Session

#: Probes along each axis and rays of each, on a GPU and on a CPU; width of the lightmap, texels.
_CARD, _PROCESSOR = ((32, 256), (64, 256)), ((8, 256), (16, 256))
_WIDTH = 256

#: Bakes of each kind; an odd number, since the median counts.
_BAKES = 3


def run(options: Options) -> list[dict[str, Any]]:
    """Bake volumes in the Cornell box."""
    return [_measured(*case) for case in (_CARD if options.gpu else _PROCESSOR)]


def tables(records: list[dict[str, Any]], options: Options) -> str:
    """Return the seconds of stage *light probes*."""
    rows = [
        (f"{record['side']}³", record["samples"], record["first"], record["relit"], record["bake"])
        for record in records
    ]
    return table(("probes", "rays", "first, s", "relit, s", "whole bake, s"), rows)


def _measured(side: int, samples: int) -> dict[str, Any]:
    """Return the times of a volume that fills the box."""
    matrix = np.diag([0.45 * ROOM] * 3 + [1.0])
    matrix[:3, 3] = ROOM / 2
    scene = replace(cornell_box(_WIDTH), probe_volumes=(ProbeVolume("Volume", matrix, (side,) * 3),))
    chosen = settings(
        QUALITIES["preview"].values, resolution=_WIDTH, light_probes=True, probe_samples=samples
    )
    session = Session()
    finished(session.bake(scene, chosen))
    first, relit, whole = [], [], []
    for _ in range(_BAKES):
        session.forget()
        began = time.perf_counter()
        first.append(_probe_seconds(session, scene, chosen))
        whole.append(time.perf_counter() - began)
        relit.append(_probe_seconds(session, relit_scene(scene), chosen))
    session.close()
    times = {"first": first, "relit": relit, "bake": whole}
    medians = {name: statistics.median(seconds) for name, seconds in times.items()}
    return {"side": side, "samples": samples, **medians}


def _probe_seconds(session: Session, scene: Scene, chosen: Any) -> float:
    """Bake; return the seconds of stage *light probes*."""
    return float(finished(session.bake(scene, chosen)).report.seconds["light probes"])
