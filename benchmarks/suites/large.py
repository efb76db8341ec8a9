"""Measures time by stage and peak memory of scenes with millions of triangles, texels and instances."""

from __future__ import annotations

from math import ceil, sqrt
from typing import Any

import numpy as np

from benchmarks import baking
from benchmarks.apart import run_apart
from benchmarks.configurations import settings
from benchmarks.options import Options
from benchmarks.rooms import cornell_box, hilly_room, with_instances
from benchmarks.tables import mebibytes, table
from engine import Scene
from engine.quality import QUALITIES

#: Triangles and texels of each case; on a processor with `--full`, the first texels alone.
_TRIANGLES, _TEXELS = (400_000, 3_000_000, 13_000_000), (1_000_000, 16_000_000, 64_000_000)

#: Texels of the cases on a processor, and triangles unless all is wanted.
_SMALL_TEXELS, _SMALL_TRIANGLES = 65_536, (400_000,)

#: Boxes without lightmaps in a room, one mesh each, and their number on a processor.
_INSTANCES, _FEW_INSTANCES = 50_000, 2_000

#: Maximum time of a case, s.
_LIMIT = 280.0

#: Width of the lightmap that builds all programs first, texels.
_WARM_UP = 192


def run(options: Options) -> list[dict[str, Any]]:
    """Bake each number of triangles with each number of texels, then a room with instances.

    `Options.only` selects cases by name, such as 13M-64M for 13 M triangles and 64 M texels, or instances.
    """
    texels = _TEXELS if options.gpu else (_SMALL_TEXELS,)
    triangles = _TRIANGLES if options.gpu or options.full else _SMALL_TRIANGLES
    cases = {
        f"{_millions(count)}-{_millions(size)}": {
            "triangles": count, "resolution": ceil(sqrt(size)), "instances": 0,
        }
        for size in texels
        for count in triangles
    }  # fmt: skip
    instances = _INSTANCES if options.gpu or options.full else _FEW_INSTANCES
    cases["instances"] = {"triangles": 12, "resolution": ceil(sqrt(texels[0])), "instances": instances}
    return [_measured(case) for name, case in cases.items() if not options.only or name in options.only]


def tables(records: list[dict[str, Any]], options: Options) -> str:
    """Return the seconds of each stage and the peak memory."""
    stages = list(dict.fromkeys(stage for record in records for stage in record.get("stages", {})))
    titles = (
        "triangles", "texels", "patches", "instances", "method", *stages, "total", "scene", "host peak",
        "host peak / scene", "device peak",
    )  # fmt: skip
    return table(titles, [_row(record, stages) for record in records])


def case(triangles: int, resolution: int, instances: int) -> dict[str, Any]:
    """Bake a small room, so that all programs are built, then the case; return its figures."""
    values = QUALITIES["preview"].values
    baking.timed(cornell_box(_WARM_UP), settings(values, resolution=_WARM_UP))
    scene = with_instances(hilly_room(resolution, triangles), instances)
    seconds, lightmap = baking.timed(scene, settings(values, resolution=resolution))
    counted = sum(len(mesh.positions) for mesh in scene.meshes)
    return {
        "seconds": seconds, "counted": counted, "scene_bytes": _bytes(scene), **baking.facts(lightmap),
    }  # fmt: skip


def _millions(count: int) -> str:
    return f"{count / 1e6:.2g}M"


def _measured(arguments: dict[str, Any]) -> dict[str, Any]:
    """Return the figures of a case in a process of its own, or why there are none."""
    outcome = run_apart("benchmarks.suites.large:case", arguments, _LIMIT, watched=True)
    facts = outcome.value or {"failed": outcome.error}
    device = facts.get("device_bytes") or outcome.device_bytes
    return {**arguments, **facts, "host_bytes": outcome.host_bytes, "device_bytes": device}


def _bytes(scene: Scene) -> int:
    """Return the size of the arrays of a scene's meshes, bytes."""
    arrays = (value for mesh in scene.meshes for value in vars(mesh).values())
    return sum(array.nbytes for array in arrays if isinstance(array, np.ndarray))


def _row(record: dict[str, Any], stages: list[str]) -> tuple:
    size, host = record.get("scene_bytes"), record.get("host_bytes")
    return (
        record.get("counted", record["triangles"]), record["resolution"] ** 2, record.get("patches"),
        record["instances"], record.get("method") or record.get("failed"),
        *(record.get("stages", {}).get(stage) for stage in stages), record.get("seconds"),
        mebibytes(size), mebibytes(host), host / size if host and size else None,
        mebibytes(record.get("device_bytes")),
    )  # fmt: skip
