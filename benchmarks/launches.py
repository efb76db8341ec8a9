"""Lists launches, copies, fills and NumPy passes of bakes, by stage.

python -m benchmarks.launches SCENE [--resolution 1024] [--quality high] [--work U G] [--relit] [--list]
    [--device-only] [--checkout FOLDER] [--arrays FOLDER]

SCENE is made of arrays, or stored in --arrays by `benchmarks.scene_arrays`.

U is a bake as users get it: four points in texels that show several things, seams hidden, dilation. G gathers
at one point of each texel and leaves seams: the work that other bakers do. Bakes are warm: a first one builds
kernels, and nothing is kept from it but with --relit, which bakes again with a lamp of another colour. Passes
of NumPy are the calls of functions and methods that take 20 us or more, in a bake of their own, which
--device-only leaves out; operators of arrays are not among them. --checkout measures the engine of
another checkout.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.device_log import COPY, DOWNLOAD, FILL, LAUNCH, PASS, UPLOAD, DeviceLog, Entry
from benchmarks.stored_scenes import RESOLUTIONS, stored_scene
from benchmarks.tables import table

if TYPE_CHECKING:
    from engine import Scene, Settings
    from engine.session import Session

#: Settings of each kind of work.
WORK: dict[str, dict[str, Any]] = {
    "U": {"texel_samples": 4, "hide_seams": True, "centres": False},
    "G": {"texel_samples": 1, "hide_seams": False, "margin": 0, "centres": False},
}

#: Earlier names of settings, for checkouts that have them.
_EARLIER = {"margin": "dilation"}

#: Scenes, and the width of their lightmaps, texels.
SCENES = {"box": 1024, "hall": 2048, "furnished": 1024, "sealed": 1024}


def main() -> None:
    """Bake a scene and print tables."""
    arguments = _parse()
    if arguments.checkout:
        sys.path.insert(0, str(arguments.checkout.resolve()))
    from engine.session import Session

    resolution = arguments.resolution or {**SCENES, **RESOLUTIONS}[arguments.scene]
    scene = made_scene(arguments.scene, resolution, arguments.arrays)
    for work in arguments.work:
        settings = _settings(resolution, arguments.quality, work)
        log, session = DeviceLog(), Session()
        with log.logging():
            _bake(session, scene, settings)
            for again in (False, True) if arguments.relit else (False,):
                what = "relit" if again else "warm"
                print(f"\n## {arguments.scene} {resolution}², {arguments.quality}, {work}, {what}\n")
                logged(log, session, scene, settings, again, arguments.device_only)
                print(report(log, arguments.list), flush=True)
        session.close()


def logged(
    log: DeviceLog, session: Session, scene: Scene, settings: Settings, again: bool, device_only: bool
) -> None:
    """Log a bake, and NumPy's passes of another one unless `device_only`.

    log: of a session that has baked the scene; again: whether what it keeps is used, and a lamp is changed
    """
    _bake_logged(log, session, scene, settings, again)
    if device_only:
        return
    entries, seconds = list(log.entries), dict(log.seconds)
    with log.passes():
        _bake_logged(log, session, scene, settings, again)
    log.entries = entries + [entry for entry in log.entries if entry.kind == PASS]
    log.seconds = seconds


def report(log: DeviceLog, listed: bool) -> str:
    """Return tables by stage, by kernel, and with `listed` by caller of each command."""
    launches = sum(entry.kind == LAUNCH for entry in log.entries)
    parts = [f"{sum(log.seconds.values()):.3f} s, {launches:,} launches"]
    parts += [by_stage(log.entries, log.seconds), by_kernel(log.entries)]
    return "\n\n".join(parts + ([by_caller(log.entries)] if listed else []))


def by_stage(entries: Iterable[Entry], seconds: dict[str, float]) -> str:
    """Return a table of entries by stage; seconds: wall time of each."""
    rows = defaultdict(list)
    for entry in entries:
        rows[entry.stage].append(entry)
    names = [*seconds, *(stage for stage in rows if stage not in seconds)]
    titles = ["stage", "wall, ms", "launches", "on the device, ms"]
    for kind in ("uploads", "downloads", "copies", "fills"):
        titles += [kind, "MB"]
    titles += ["NumPy passes", "ms"]
    lines = [_stage_row(stage, 1e3 * seconds.get(stage, 0.0), rows[stage]) for stage in names]
    everything = [entry for stage in rows.values() for entry in stage]
    return table(titles, [*lines, _stage_row("all", 1e3 * sum(seconds.values()), everything)])


def by_kernel(entries: Iterable[Entry]) -> str:
    """Return a table of launches by kernel, the longest first."""
    times: dict[str, list[float]] = defaultdict(list)
    for entry in entries:
        if entry.kind == LAUNCH:
            times[entry.name].append(entry.device_seconds)
    order = sorted(times, key=lambda name: -sum(times[name]))
    rows = [(name, len(times[name]), sum(times[name]), 1e3 * max(times[name])) for name in order]
    return table(("kernel", "launches", "s", "longest, ms"), rows)


def by_caller(entries: Iterable[Entry]) -> str:
    """Return a table of all entries by stage, kind and name, in the order in which they began."""
    groups: dict[tuple[str, str, str], list[Entry]] = defaultdict(list)
    for entry in entries:
        groups[entry.stage, entry.kind, entry.name].append(entry)
    rows = [
        (
            *key,
            len(group),
            sum(entry.size for entry in group) / 1e6,
            1e3 * sum(entry.seconds for entry in group),
        )
        for key, group in groups.items()
    ]
    return table(("stage", "kind", "name", "number", "MB", "host, ms"), rows)


def _stage_row(stage: str, wall: float, entries: list[Entry]) -> tuple[Any, ...]:
    """Return a row of `by_stage`."""
    kinds: dict[str, list[Entry]] = defaultdict(list)
    for entry in entries:
        kinds[entry.kind].append(entry)
    row: list[Any] = [stage, wall, len(kinds[LAUNCH])]
    row.append(1e3 * sum(entry.device_seconds for entry in kinds[LAUNCH]))
    for kind in (UPLOAD, DOWNLOAD, COPY, FILL):
        row += [len(kinds[kind]), sum(entry.size for entry in kinds[kind]) / 1e6]
    return *row, len(kinds[PASS]), 1e3 * sum(entry.seconds for entry in kinds[PASS])


def _bake_logged(log: DeviceLog, session: Session, scene: Scene, settings: Settings, again: bool) -> None:
    """Bake and log."""
    if again:
        scene = relit_scene(scene)
    else:
        session.forget()
    log.clear()
    _bake(session, scene, settings)
    log.end()


def _bake(session: Session, scene: Scene, settings: Settings) -> None:
    """Bake to the end."""
    from engine import finished

    finished(session.bake(scene, settings))


def relit_scene(scene: Scene) -> Scene:
    """Return a scene whose first lamp, or without lamps whose emissive surfaces, have another strength."""
    if scene.lights:
        first = replace(scene.lights[0], strength=scene.lights[0].strength * 1.25)
        return replace(scene, lights=(first, *scene.lights[1:]))
    brighter = [replace(made, emission=made.emission * 1.25) for made in scene.materials]
    return replace(scene, materials=tuple(brighter))


def made_scene(name: str, resolution: int, arrays: Path | None) -> Scene:
    """Return a scene by its name; arrays: folder of stored scenes."""
    from benchmarks.halls import hall
    from benchmarks.interiors import furnished_room, sealed_rooms
    from benchmarks.rooms import cornell_box

    makers: dict[str, Callable[[int], Scene]] = {
        "box": cornell_box, "hall": hall, "furnished": furnished_room, "sealed": sealed_rooms,
    }  # fmt: skip
    if name in RESOLUTIONS:
        if arrays is None:
            raise SystemExit(
                f"'{name}' is a scene of Blender. Store it with benchmarks.scene_arrays, and add --arrays."
            )
        return stored_scene(arrays, name)
    return makers[name](resolution)


def _settings(resolution: int, quality: str, work: str) -> Settings:
    """Return the settings of a bake."""
    from benchmarks.configurations import settings
    from engine import Settings
    from engine.quality import QUALITIES

    known = {field.name for field in fields(Settings)}
    named = {name if name in known else _EARLIER[name]: value for name, value in WORK[work].items()}
    return settings(dict(QUALITIES[quality].values), resolution=resolution, **named)


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", choices=(*SCENES, *RESOLUTIONS))
    parser.add_argument("--resolution", type=int, help="width of the lightmap, texels")
    parser.add_argument("--quality", default="high", choices=("draft", "preview", "high", "very_high"))
    parser.add_argument("--work", nargs="+", default=list(WORK), choices=WORK)
    parser.add_argument("--relit", action="store_true", help="bake once more after a change of light")
    parser.add_argument("--device-only", action="store_true", help="do not bake again for NumPy's passes")
    parser.add_argument("--list", action="store_true", help="list what asked for each command")
    parser.add_argument("--checkout", type=Path, help="folder of another checkout, whose engine is measured")
    parser.add_argument("--arrays", type=Path, help="folder that benchmarks.scene_arrays has written")
    return parser.parse_args()


if __name__ == "__main__":
    main()
