"""Measures the seconds of Hemibake and Cycles to the same error in Blender scenes."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.configurations import configurations, label
from benchmarks.curves import Reach, reach, reach_by_sampling, text_of
from benchmarks.machine import has_bpy
from benchmarks.options import ROOT, Options
from benchmarks.tables import percent, table

#: Relative errors to reach.
_TARGETS = (0.05, 0.02)

#: Over all texels, and off the edges of light.
_ERRORS = {"rmse": "all texels", "smooth": "off edges"}


@dataclass(frozen=True)
class _Case:
    """A scene, the width of its lightmaps and the samples of each half of its reference."""

    name: str
    file: str | None
    resolution: int
    samples: int


_SMALL = (_Case("demo", None, 96, 1024), _Case("living_room", "living_room.blend", 128, 128))
_ALL = (
    _Case("living_room", "living_room.blend", 256, 256),
    _Case("complex", "complex.obj", 512, 128),
    _Case("house", "house.glb", 512, 256),
    _Case("demo", None, 192, 1024),
    _Case("hall", None, 512, 64),
)

#: Scenes that the suite does not compare.
_ONLY_OPENED = (_Case("gazebo", "gazebo.obj", 512, 128),)


def run(options: Options) -> list[dict[str, Any]]:
    """Measure the curves of all scenes; files that are absent are named."""
    if not has_bpy():
        return [{"scene": "all", "skipped": "Blender is not there as a Python module (bpy)"}]
    sys.path.insert(0, str(ROOT / "tools"))
    from tools.headless import blender

    records = []
    with blender():
        for case in _ALL if options.full or options.gpu else _SMALL:
            if options.only and case.name not in options.only:
                continue
            path = case.file and Path(options.scenes) / case.file
            if path and not path.exists():
                records.append({"scene": case.name, "skipped": f"{case.file} is not in the folder of scenes"})
                continue
            try:
                records.append(_measure(case, path, options))
            except (Exception, SystemExit) as error:  # noqa: BLE001
                records.append({"scene": case.name, "failed": f"{type(error).__name__}: {error}"})
    return records


def tables(records: list[dict[str, Any]], options: Options) -> str:
    """Return the seconds to each error and their ratio, then the curves."""
    titles = ("scene", "width", "error of", "below", "Hemibake, s", "Cycles, s", "Cycles on", "ratio",
              "least error of Hemibake")  # fmt: skip
    rows: list[tuple] = []
    for record in records:
        if "contests" not in record:
            said = record.get("skipped") or record.get("failed")
            rows.append((record["scene"], None, None, None, said, *[None] * 4))
            continue
        rows += [_row(record, contest) for contest in record["contests"]]
    curves = [_curves(record) for record in records if "contests" in record]
    return "\n\n".join([table(titles, rows), *curves])


def contests(hemibake: list[dict[str, Any]], cycles: dict[str, list[dict[str, Any]]]) -> list[dict[str, Any]]:
    """Return when both reach each error, Cycles on the device that is faster."""
    from benchmarks.contest import points

    results = []
    for error in _ERRORS:
        ours = points(hemibake, error)
        for target in _TARGETS:
            ourselves = reach(ours, target)
            theirs = {
                device: reach_by_sampling(
                    [record["samples"] for record in curve if record[error] is not None],
                    points(curve, error),
                    target,
                )
                for device, curve in cycles.items()
            }
            device = min(theirs, key=lambda device: theirs[device].seconds or float("inf"))
            results.append({
                "error": error, "target": target, "device": device,
                "hemibake": vars(ourselves), "cycles": vars(theirs[device]),
                "ratio": _ratio(theirs[device], ourselves),
            })  # fmt: skip
    return results


def _ratio(theirs: Reach, ours: Reach) -> float | None:
    """Return how many times faster Hemibake is, None if nothing can be said."""
    if not (theirs.seconds and ours.seconds) or theirs.how == ours.how == "at most":
        return None
    return theirs.seconds / ours.seconds


def open_scene(name: str, folder: Path, resolution: int) -> None:
    """Open a scene of the folder in Blender; `resolution` is the width of its lightmap, texels."""
    case = replace(next(case for case in (*_ALL, *_ONLY_OPENED) if case.name == name), resolution=resolution)
    _open(case, folder / case.file if case.file else None)


def _open(case: _Case, path: Path | None) -> None:
    """Open a scene in Blender in place of the open one."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    _OPENERS[case.name](case, path)


def _measure(case: _Case, path: Path | None, options: Options) -> dict[str, Any]:
    """Open a scene and measure both curves."""
    import bpy

    from benchmarks import contest
    from tools.headless import quiet_stdout
    from tools.verification.cycles import realised
    from tools.verification.run import known_texels, read_for_bake

    limit = 40.0 if options.full or options.gpu else 25.0
    with quiet_stdout():
        _open(case, path)
    with tempfile.TemporaryDirectory(prefix="hemibake-bench-") as folder:
        settings = bpy.context.scene.hemibake
        settings.resolution, settings.directory = case.resolution, folder

        # Cycles leaves seams as they are.
        settings.hide_seams = False
        with quiet_stdout():
            read, chosen = read_for_bake(bpy.context)
        known_of = partial(known_texels, scene=read.scene, settings=chosen)
        with realised(bpy.context, read, case.resolution) as cycles:
            reference = contest.Reference(
                bpy.context, cycles, read, chosen, case.name, case.samples, Path(options.cache)
            )
            ours, known = contest.hemibake_curve(bpy.context, reference, known_of, configurations(), limit)
            theirs = {
                device: contest.cycles_curve(cycles, reference, known, device, min(_TARGETS), limit)
                for device in contest.cycles_devices(options.gpu)
            }
    return {
        "scene": case.name,
        "resolution": case.resolution,
        "triangles": read.triangles,
        "reference_samples": 2 * reference.samples,
        "hemibake": ours,
        "cycles": theirs,
        "contests": contests(ours, theirs),
    }


def _open_demo(case: _Case, path: Path | None) -> None:
    sys.path.insert(0, str(ROOT / "examples"))
    import cornell_box

    cornell_box.build()


def _open_living_room(case: _Case, path: Path) -> None:
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)

    # The file was saved in Edit Mode, in which each bake has all modifiers evaluated several times.
    for obj in bpy.context.view_layer.objects:
        if obj.mode != "OBJECT":
            with bpy.context.temp_override(object=obj, active_object=obj):
                bpy.ops.object.mode_set(mode="OBJECT")
    _whiten_world()


def _open_house(case: _Case, path: Path) -> None:
    from tools.verification import scenes

    scenes.register_files(path.parent)
    scenes.SCENES["house"]()


def _open_whitened(case: _Case, path: Path) -> None:
    import bpy

    bpy.ops.wm.obj_import(filepath=str(path))
    _whiten_world()


def _open_hall(case: _Case, path: Path | None) -> None:
    from benchmarks.blender_hall import build_hall

    build_hall(case.resolution)


def _whiten_world() -> None:
    """Give the open scene a constant background."""
    from tools.headless import load

    load("operators.command_line.open_scene").replace_world((1.0, 1.0, 1.0))


_OPENERS: dict[str, Callable] = {
    "demo": _open_demo,
    "living_room": _open_living_room,
    "house": _open_house,
    "complex": _open_whitened,
    "gazebo": _open_whitened,
    "hall": _open_hall,
}


def _row(record: dict[str, Any], contest: dict[str, Any]) -> tuple:
    error = contest["error"]
    least = min((point[error] for point in record["hemibake"] if point[error] is not None), default=None)
    return (
        record["scene"], record["resolution"], _ERRORS[error], f"{contest['target']:.0%}",
        text_of(Reach(**contest["hemibake"])), text_of(Reach(**contest["cycles"])), contest["device"],
        _ratio_text(contest), percent(least),
    )  # fmt: skip


def _ratio_text(contest: dict[str, Any]) -> str | None:
    """Return a ratio as a cell: a bound where one of both times is one."""
    if contest["ratio"] is None:
        return None
    marks = {contest["hemibake"]["how"]: "≥ ", contest["cycles"]["how"]: "≤ "}
    return f"{marks.get('at most', '')}{contest['ratio']:.2g}×"


def _curves(record: dict[str, Any]) -> str:
    """Return all that was measured in a scene."""
    rows = [
        ("Hemibake", label(_values(point)), point["seconds"], *_percents(point))
        for point in record["hemibake"]
    ]
    for device, curve in record["cycles"].items():
        rows += [
            (f"Cycles, {device}", f"{point['samples']} samples", point["seconds"], *_percents(point))
            for point in curve
        ]
    return f"{record['scene']}\n\n" + table(("baker", "settings", "s", "RMSE", "off edges", "bias"), rows)


def _values(point: dict[str, Any]) -> dict[str, Any]:
    names = ("visibility", "samples", "hemicube", "light_samples", "tolerance", "adaptive")
    return {name: point[name] for name in names if name in point}


def _percents(point: dict[str, Any]) -> list[str]:
    known = [percent(point[error]) or "below the reference's noise" for error in _ERRORS]
    return [*known, f"{point['bias']:+.2%}"]
