"""Measures light probes: the first bake of a volume, and bakes after changes of light."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.configurations import settings
from benchmarks.launches import relit_scene
from benchmarks.options import Options
from benchmarks.rooms import ROOM, cornell_box, dark_box
from benchmarks.tables import table
from engine import Scene, finished
from engine.device.freed_memory import keep_freed_memory
from engine.quality import QUALITIES
from engine.scene.probe_volume import ProbeVolume
from engine.session import Session

#: Probes along each axis and rays of each, on a GPU and on a CPU; width of the lightmap, texels.
_CARD, _PROCESSOR = ((32, 256), (64, 256)), ((8, 256), (16, 256))
_WIDTH = 256

#: Bakes of each kind; an odd number, since the median counts. Radius of the lamp with a size, m.
_BAKES, _RADIUS = 5, 0.1

#: Distance by which a lamp moves in each bake, m.
_STEP = 0.05

#: Columns of changes of light, by the name in the records.
_CHANGES = {
    "emission": "emission",
    "color": "color of a lamp",
    "moved": "lamp moved",
    "sized": "lamp with a size moved",
}


def run(options: Options) -> list[dict[str, Any]]:
    """Bake volumes in the Cornell box, and in the same box lit by a lamp."""
    keep_freed_memory()
    return [_measured(*case) for case in (_CARD if options.gpu else _PROCESSOR)]


def tables(records: list[dict[str, Any]], options: Options) -> str:
    """Return the seconds of stage *light probes*: of a first bake, and after each change of light."""
    columns = ("first", *_CHANGES, "bake")
    rows = [
        (f"{record['side']}³", record["samples"], *(record[column] for column in columns))
        for record in records
    ]
    return table(
        ("probes", "rays", "first, s", *(f"{text}, s" for text in _CHANGES.values()), "whole bake, s"), rows
    )


def _measured(side: int, samples: int) -> dict[str, Any]:
    """Return the median times of a volume that fills the box."""
    matrix = np.diag([0.45 * ROOM] * 3 + [1.0])
    matrix[:3, 3] = ROOM / 2
    volumes = (ProbeVolume("Volume", matrix, (side,) * 3),)
    box, dark = (
        replace(scene, probe_volumes=volumes) for scene in (cornell_box(_WIDTH), dark_box(_WIDTH, 1))
    )
    chosen = settings(
        QUALITIES["preview"].values, resolution=_WIDTH, light_probes=True, probe_samples=samples
    )
    changes: dict[str, Callable[[int], Scene]] = {
        "emission": lambda turn: relit_scene(box) if turn % 2 else box,
        "color": lambda turn: relit_scene(dark) if turn % 2 else dark,
        "moved": lambda turn: _with_lamp(dark, 0.0, turn),
        "sized": lambda turn: _with_lamp(dark, _RADIUS, turn),
    }
    times: dict[str, list[float]] = {"first": [], "bake": []}
    for name, scene_of in changes.items():
        with closing(Session()) as session:
            finished(session.bake(scene_of(0), chosen))
            for _ in range(_BAKES if name == "emission" else 0):
                session.forget()
                began = time.perf_counter()
                times["first"].append(_probe_seconds(session, scene_of(0), chosen))
                times["bake"].append(time.perf_counter() - began)
            times[name] = [_probe_seconds(session, scene_of(turn), chosen) for turn in range(1, _BAKES + 1)]
    medians = {name: statistics.median(seconds) for name, seconds in times.items()}
    return {"side": side, "samples": samples, **medians}


def _with_lamp(scene: Scene, radius: float, turn: int) -> Scene:
    """Return a scene whose lamp has a radius, m, and has moved `turn` times."""
    (lamp,) = scene.lights
    moved = lamp.position + np.array([turn * _STEP, 0, 0])
    return replace(scene, lights=(replace(lamp, position=moved, radius=radius),))


def _probe_seconds(session: Session, scene: Scene, chosen: Any) -> float:
    """Bake; return the seconds of stage *light probes*."""
    return float(finished(session.bake(scene, chosen)).report.seconds["light probes"])
