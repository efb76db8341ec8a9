"""Measures a Cornell box from arrays to arrays to 2 % RMSE, against a converged bake and Cycles."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import baking
from benchmarks.configurations import configurations, fine, finest, label, settings
from benchmarks.curves import Point, Reach, reach, text_of
from benchmarks.machine import has_bpy
from benchmarks.options import ROOT, Options
from benchmarks.rooms import cornell_box
from benchmarks.tables import percent, table
from engine import Scene

_TARGET = 0.02

#: Width of the lightmaps, texels: 14,400 and 1 M texels; samples of each half of Cycles' reference.
_SMALL, _LARGE = (120, 1024), (1024, 512)


def run(options: Options) -> list[dict[str, Any]]:
    """Measure one lightmap, or both on a graphics card or if all is wanted."""
    if not has_bpy():
        return [_measure(*case, options, None) for case in _cases(options)]
    sys.path.insert(0, str(ROOT / "tools"))
    from tools.headless import blender

    with blender():
        import bpy

        return [_measure(*case, options, bpy) for case in _cases(options)]


def tables(records: list[dict[str, Any]], options: Options) -> str:
    """Return the seconds to the error, then the curves."""
    titles = ("texels", "patches", "error against", "s to 2 %", "least error")
    rows = [
        (
            record["resolution"] ** 2,
            record["patches"],
            name,
            text_of(Reach(**found["reach"])),
            percent(found["least"]),
        )
        for record in records
        for name, found in record["against"].items()
    ]
    return "\n\n".join([table(titles, rows), *(_curve(record) for record in records)])


def _cases(options: Options) -> list[tuple[int, int]]:
    return [_SMALL, _LARGE] if options.gpu or options.full else [_SMALL]


def _measure(resolution: int, samples: int, options: Options, bpy) -> dict[str, Any]:
    """Bake from coarse to fine, each a second time in this process; compare with what is converged."""
    scene = cornell_box(resolution)
    limit = 120.0 if options.full or options.gpu else 20.0
    _, converged = baking.timed(scene, settings(_finest(resolution), resolution=resolution))
    truth, has_patch = converged.image, converged.has_patch
    reference = _cycles(bpy, scene, resolution, samples, options) if bpy else None
    known = has_patch & (converged.image == converged.display).all(axis=-1)
    baking.timed(scene, settings(configurations()[0], resolution=resolution))
    curve, too_slow = [], set()
    for values in configurations():
        if values["visibility"] in too_slow or (resolution > _SMALL[0] and values["visibility"] == "raster"):
            continue
        seconds, lightmap = baking.best_of_two(scene, settings(values, resolution=resolution))
        point = {"values": values, "seconds": seconds, "own": _rmse(lightmap.image, truth, has_patch)}
        if reference is not None:
            point["cycles"] = reference.compare_centres(lightmap.image, known).rmse or None
        curve.append({**point, **baking.facts(lightmap)})
        if seconds > limit:
            too_slow.add(values.get("visibility"))
    against = {"our own converged bake": _found(curve, "own")}
    if reference is not None:
        against["Cycles"] = _found(curve, "cycles")
    return {
        "resolution": resolution,
        "patches": int(has_patch.sum()),
        "converged": label(_finest(resolution)),
        "curve": curve,
        "against": against,
    }


def _finest(resolution: int) -> dict[str, Any]:
    return finest() if resolution <= _SMALL[0] else fine()


def _rmse(image: np.ndarray, truth: np.ndarray, has_patch: np.ndarray) -> float:
    """Return the root of the mean squared difference, relative to the mean."""
    difference = (image[has_patch] - truth[has_patch]).astype(np.float64)
    return float(np.sqrt((difference**2).mean()) / truth[has_patch].mean(dtype=np.float64))


def _found(curve: list[dict[str, Any]], error: str) -> dict[str, Any]:
    known = [point for point in curve if point[error] is not None]
    points = [Point(label(point["values"]), point["seconds"], point[error]) for point in known]
    least = min((point.error for point in points), default=None)
    return {"reach": vars(reach(points, _TARGET)), "least": least}


def _cycles(bpy, scene: Scene, resolution: int, samples: int, options: Options):
    """Return Cycles' reference of the same arrays."""
    from benchmarks.contest import Reference
    from tools.headless import quiet_stdout
    from tools.verification.cycles import realised
    from tools.verification.run import read_for_bake

    with quiet_stdout():
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        _build(bpy, scene)
        bpy.context.scene.hemibake.resolution = resolution
        read, chosen = read_for_bake(bpy.context)
    with realised(bpy.context, read, resolution) as cycles:
        return Reference(bpy.context, cycles, read, chosen, f"box-{resolution}", samples, Path(options.cache))


def _build(bpy, scene: Scene) -> None:
    """Add a scene's one mesh to Blender's, with the same lightmap UVs."""
    from tools.verification.scenes import material

    (mesh,) = scene.meshes
    count = len(mesh.positions)
    data = bpy.data.meshes.new(mesh.name)
    data.from_pydata(mesh.positions.reshape(-1, 3).tolist(), [], np.arange(3 * count).reshape(-1, 3).tolist())
    data.uv_layers.new(name="Lightmap").uv.foreach_set("vector", mesh.uvs.ravel())
    for surface in scene.materials:
        made = material(surface.name, tuple(map(float, surface.reflectance)))
        node = made.node_tree.nodes["Principled BSDF"]
        node.inputs["Emission Color"].default_value = (*map(float, surface.emission), 1.0)
        node.inputs["Emission Strength"].default_value = 1.0
        data.materials.append(made)
    data.polygons.foreach_set("material_index", mesh.material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new(mesh.name, data))


def _curve(record: dict[str, Any]) -> str:
    titles = ("settings", "s", "RMSE to converged", "RMSE to Cycles")
    rows = [
        (label(point["values"]), point["seconds"], percent(point["own"]), percent(point.get("cycles")))
        for point in record["curve"]
    ]
    return (
        f"Lightmap of {record['resolution']}², converged with {record['converged']}\n\n{table(titles, rows)}"
    )
