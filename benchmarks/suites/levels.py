"""Measures CPU time and peak memory by stage of large levels that the add-on unwraps, reads and bakes."""

from __future__ import annotations

import os
import time
from importlib import import_module
from math import ceil, sqrt
from typing import Any

import numpy as np

from benchmarks.apart import run_apart
from benchmarks.machine import has_bpy
from benchmarks.options import Options
from benchmarks.tables import mebibytes, table

#: Triangles and texels of the cases. A processor runs the small ones and, if they are named, those with 1 M
#: texels. Unless all is wanted, it bakes levels of at most _BAKED triangles and reads the others.
_TRIANGLES = (400_000, 1_000_000, 3_000_000, 13_000_000)
_TEXELS = (1_000_000, 16_000_000, 64_000_000)
_SMALL_TEXELS, _BAKED = (65_536,), 3_000_000

#: Seconds after which the worker has returned its free memory, see engine/worker/child.py.
_TRIMMED = 1.0

#: Number of spheres, and of instances in a level of its own.
_OBJECTS, _INSTANCES = 200, 50_000

#: Texels of a lightmap of the instances, on a graphics card and on a processor. Tiles have a least size, so
#: that the instances take 9 lightmaps of 1000² or 22 of 512².
_OF_INSTANCES = 1_000_000, 262_144


def run(options: Options) -> list[dict[str, Any]]:
    """Bake each number of triangles with each number of texels, then a level with instances.

    `Options.only` selects cases by name, such as 13M-1M for 13 M triangles and 1 M texels, or instances.
    """
    if not has_bpy():
        return [{"skipped": "Blender is not there as a Python module (bpy)"}]
    all_bake = options.gpu or options.full
    texels = _TEXELS if options.gpu else (*_SMALL_TEXELS, _TEXELS[0])
    cases = {
        f"{count / 1e6:.2g}M-{size / 1e6:.2g}M": {
            "triangles": count, "texels": size, "instances": 0, "bakes": all_bake or count <= _BAKED,
        }
        for size in texels
        for count in _TRIANGLES
    }  # fmt: skip
    size = _OF_INSTANCES[0 if options.gpu else 1]
    cases["instances"] = {"triangles": 0, "texels": size, "instances": _INSTANCES, "bakes": True}
    usual = [name for name, case in cases.items() if options.gpu or case["texels"] != _TEXELS[0]]
    chosen = {name: case for name, case in cases.items() if name in (options.only or [*usual, "instances"])}
    return [_measured(name, arguments) for name, arguments in chosen.items()]


def tables(records: list[dict[str, Any]], options: Options) -> str:
    """Return a table for each level, with CPU time and peak memory of each stage, and one of their growth."""
    return "\n\n".join([*map(_table, records), *_growth(records)])


class _ReadError(Exception):
    """Ends a run that only reads."""


def case(triangles: int, texels: int, instances: int, bakes: bool) -> dict[str, Any]:
    """Build a level, unwrap and read it, and bake it by a worker if wanted; return the use of each stage."""
    from tools.headless import MODULE, blender

    with blender():
        import bpy

        from benchmarks.blender_level import build_level
        from benchmarks.process_memory import ProcessMemory

        fixed = _warm_up()
        build_level(_OBJECTS if triangles else 0, triangles, instances)
        settings = bpy.context.scene.hemibake
        settings.resolution, settings.quality = ceil(sqrt(texels)), "preview"
        bake_run = import_module(f"{MODULE}.operators.bake_run")
        owner = import_module(f"{MODULE}.operators.worker_manager").owner
        bpy.context.evaluated_depsgraph_get()
        facts: dict[str, int] = {}

        def bake(scene: Any, settings: Any) -> Any:
            """Bake in the worker, and note the size of the scene."""
            arrays = [value for mesh in scene.meshes for value in vars(mesh).values()]
            facts["counted"] = sum(len(mesh.positions) for mesh in scene.meshes)
            facts["scene_bytes"] = sum(array.nbytes for array in arrays if isinstance(array, np.ndarray))
            if not bakes:
                raise _ReadError
            return owner.bake_in_worker()(scene, settings)

        with ProcessMemory() as memory:
            run = bake_run.BakeRun(bpy.context, bake, watched=False, in_worker=True)
            try:
                result = run.run_to_end(lambda progress: memory.begin(progress.stage))
                memory.begin("Saving")
                run.finish(result)
                facts["patches"] = int(result.report.patches)
            except _ReadError:
                run.cancel()
            except BaseException:
                run.cancel()
                raise
        return {**facts, "fixed": fixed, "stages": {name: vars(use) for name, use in memory.stages.items()}}


def _warm_up() -> int:
    """Bake a box in the worker, and empty the file; return the memory that stays in both processes, bytes.

    It holds Python, drivers and kernels, which do not grow with a scene.
    """
    import bpy

    from benchmarks.blender_level import build_level
    from benchmarks.process_memory import used_memory
    from tools.headless import MODULE

    bake_run = import_module(f"{MODULE}.operators.bake_run")
    owner = import_module(f"{MODULE}.operators.worker_manager").owner
    before = used_memory()
    build_level(1, 100)
    bpy.context.scene.hemibake.quality = "preview"
    bpy.context.scene.hemibake.resolution = 64
    run = bake_run.BakeRun(bpy.context, owner.bake_in_worker(), watched=False)
    run.run_to_end()
    run.cancel()
    owner.forget()
    owner.worker().call("engine.device.freed_memory:give_back_freed_memory")
    for item in (*bpy.data.objects, *bpy.data.meshes, *bpy.data.materials, *bpy.data.images):
        bpy.data.batch_remove([item])
    time.sleep(_TRIMMED)
    return used_memory() - before


def _growth(records: list[dict[str, Any]]) -> list[str]:
    """Return a table of peak memory of the baked levels, and of its growth from one level to the next."""
    baked = [record for record in records if record.get("patches") and record["triangles"]]
    rows: list[tuple[Any, ...]] = []
    last = None
    for record in baked:
        size = record["scene_bytes"]
        peak = max(use["peak"] for use in record["stages"].values())
        grown = None if last is None or size <= last[0] else (peak - last[1]) / (size - last[0])
        fixed = mebibytes(record["fixed"])
        rows.append((record["name"], mebibytes(size), fixed, mebibytes(peak), peak / size, grown))
        last = size, peak
    columns = ("level", "arrays", "fixed", "peak", "peak / arrays", "growth / arrays")
    return [table(columns, rows)] if rows else []


def _measured(name: str, arguments: dict[str, Any]) -> dict[str, Any]:
    """Return the figures of a case in a process of its own, or why there are none."""
    outcome = run_apart("benchmarks.suites.levels:case", arguments)
    return {"name": name, **arguments, **(outcome.value or {"failed": outcome.error})}


def _table(record: dict[str, Any]) -> str:
    """Return the stages of a level with the peak of all, or why there are none."""
    if "stages" not in record:
        return f"{record.get('name', 'levels')}: {record.get('skipped') or record.get('failed')}"
    size = record["scene_bytes"]
    texels = f"{record['patches']:,} texels" if "patches" in record else "not baked"
    title = (
        f"{record['name']}: {record['counted']:,} triangles, {texels}, "
        f"arrays of the scene {mebibytes(size)}, {os.cpu_count()} cores"
    )
    rows = [
        (stage, use["cpu"], mebibytes(use["peak"]), use["peak"] / size)
        for stage, use in record["stages"].items()
        if use["cpu"] >= 0.05 or use["peak"]
    ]
    total = sum(use["cpu"] for use in record["stages"].values())
    peak = max(use["peak"] for use in record["stages"].values())
    rows.append(("all", total, mebibytes(peak), peak / size))
    return f"{title}\n\n{table(('stage', 'CPU, s', 'peak memory', 'peak / arrays'), rows)}"
