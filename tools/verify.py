"""Compares Hemibake with Cycles in a suite of scenes.

    python tools/verify.py [--only NAME ...] [--samples N] [--jobs N] [--table docs/design/accuracy.md]

Prints relative RMSE and mean bias of each scene as soon as it is done; ends with status 1 if one misses its
limit. With --table each row replaces that of its scene in the table between the two marks of that file, so
that an interrupted run goes on with --only and the remaining scenes. With --jobs scenes run in several
processes, each on its share of the CPU cores.
"""

from __future__ import annotations

import argparse
import importlib
import os
import queue
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from tools.headless import MODULE, blender, quiet_stdout  # noqa: E402

#: Limits, per cent: of the RMSE off edges of light, and of the bias; for whole rooms of the local RMSE over
#: all texels, see `difference.Difference`.
SMOOTH, BIAS, ROOM = 2.0, 1.0, 3.5

_MARKS = ("<!-- table: made by tools/verify.py -->", "<!-- end of table -->")

_TITLES = (
    "scene", "RMSE", "off edges", "bias", "noise", "of areas", "off edges", "original", "edges", "texels",
    "hidden", "width", "spp", "in limits",
)  # fmt: skip

#: Last cell of a row within its limits.
_GOOD = "yes"


def main() -> None:
    """Run the scenes and print a line for each."""
    options = parse()
    with blender():
        import bpy

        from tools.verification import hair_scenes, material_scenes, object_scenes, render_scenes, scenes  # noqa: F401

        scenes.register_files(options.scenes)
        names = options.only or list(scenes.SCENES)
        unknown = set(names) - set(scenes.SCENES)
        if unknown:
            raise SystemExit(f"There is no scene {', '.join(sorted(unknown))}: {', '.join(scenes.SCENES)}.")
        options.out.mkdir(parents=True, exist_ok=True)
        rows: list[str] = []
        found = in_processes(names, options) if options.jobs > 1 else in_turn(scenes, names, options)
        for line in found:
            print(line, flush=True)
            if line.startswith("| "):
                rows.append(_row_of(line))
            if options.table:
                write_table(options.table, rows, list(scenes.SCENES), bpy.app.version_string)
    failed = [_cells(row)[0] for row in rows if _misses(row)]
    if failed:
        raise SystemExit(f"Above the limits: {', '.join(failed)}.")


def in_turn(scenes, names: Iterable[str], options: argparse.Namespace) -> Iterator[str]:
    """Run scenes one after the other; yield the row of each, followed by its wall time in s."""
    import bpy

    from tools.verification.run import verify, write_difference

    for name in names:
        if name in scenes.WORKING_SPACES and not hasattr(bpy.data, "colorspace"):
            yield f"{name}: Blender has working spaces since 5.0."
            continue
        resolution, samples = scenes.ROOMS.get(name, (64, options.samples))
        with quiet_stdout():
            build(scenes, name)
        changes = scenes.SETTINGS.get(name, {})
        set_up(bpy.context.scene.hemibake, resolution, options.texel_samples, changes)
        started = time.perf_counter()
        try:
            found = verify(bpy.context, samples, scenes.ORIGINALS.get(name), scenes.GROUPS.get(name))
        except error_type() as error:
            yield _not_baked(name, str(error))
            continue
        with quiet_stdout():
            write_difference(found.difference, options.out / f"{name}.png")
            write_difference(found.area_difference, options.out / f"{name}_areas.png")
        limits = scenes.BY_DESIGN.get(name, (SMOOTH, BIAS))
        good = passes(found, name in scenes.ROOMS, limits) and has_note(found, scenes.NOTES.get(name, ""))
        yield f"{row(name, found, samples, good)} {time.perf_counter() - started:.0f} s"


def in_processes(names: Iterable[str], options: argparse.Namespace) -> Iterator[str]:
    """Run each scene in a process of its own, `jobs` at once; yield the lines that they print."""
    cores, jobs = sorted(os.sched_getaffinity(0)), options.jobs
    shares: queue.SimpleQueue[set[int]] = queue.SimpleQueue()
    for job in range(jobs):
        shares.put(set(cores[job::jobs]) or set(cores))
    same = [f"--{name}={getattr(options, name)}" for name in ("samples", "scenes", "out")]
    if options.texel_samples:
        same.append(f"--texel-samples={options.texel_samples}")

    def run(name: str) -> str:
        share = shares.get()
        try:
            command = (
                "taskset",
                "-c",
                ",".join(map(str, share)),
                sys.executable,
                __file__,
                *same,
                "--only",
                name,
            )
            done = subprocess.run(command, stdout=subprocess.PIPE, text=True)
        finally:
            shares.put(share)
        return result_line(name, done.stdout, done.returncode)

    with ThreadPoolExecutor(jobs) as pool:
        for ended in as_completed([pool.submit(run, name) for name in names]):
            yield ended.result()


def result_line(name: str, printed: str, status: int) -> str:
    """Return the last line about a scene of the output of its process, or the row of a scene without result.

    A process that fails for another reason than the limits has no result.

    status:  exit status of the process
    """
    lines = [line for line in printed.splitlines() if line.startswith((f"| {name} |", f"{name}: "))]
    if lines and (status == 0 or (status == 1 and _misses(lines[-1]))):
        return lines[-1]
    return _not_baked(name, f"the process ended with status {status}")


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", metavar="NAME", help="scenes to run; all without it")
    parser.add_argument("--samples", type=int, default=1024, help="per texel, in each of two bakes of Cycles")
    parser.add_argument(
        "--scenes",
        type=Path,
        default=ROOT.parent / "shared" / "scenes",
        help="folder of .blend and .glb files, which are not part of the repository; scenes whose files it "
        "lacks are left out",
    )
    parser.add_argument(
        "--texel-samples", type=int, help="as the setting of that name; its default without it"
    )
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "verify", help="folder for the pictures")
    parser.add_argument("--table", type=Path, help="Markdown file whose table is replaced")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes, which share the cores")
    return parser.parse_args()


def build(scenes, name: str) -> None:
    """Make a scene in an empty file, in its working space."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    if hasattr(bpy.data, "colorspace"):
        space = scenes.WORKING_SPACES.get(name, "Linear Rec.709")
        bpy.ops.wm.set_working_color_space(working_space=space)
    scenes.SCENES[name]()


def set_up(settings, resolution: int, texel_samples: int | None, changes: Mapping[str, object]) -> None:
    """Choose accurate settings for a scene, and those that it needs in addition.

    Rays compute visibility: *Automatic* depends on the machine's load, and drawn hemicubes have one viewpoint
    for each texel, which is less accurate in gaps narrower than a texel.
    """
    settings.visibility = "rays"
    settings.resolution, settings.hemicube = resolution, "64"
    settings.tolerance, settings.light_samples, settings.adaptive = 0.001, 128, False
    if texel_samples:
        settings.texel_samples = str(texel_samples)
    for name, value in changes.items():
        setattr(settings, name, value)


def error_type() -> type[Exception]:
    """Return the base of the engine's errors, as the add-on that is enabled has it."""
    return importlib.import_module(f"{MODULE}.engine.errors").EngineError


def passes(found, is_room: bool, limits: tuple[float, float]) -> bool:
    """Return whether figures of areas keep their limits: RMSE off edges and bias, per cent.

    found:   a `Comparison`
    limits:  of the RMSE off edges and of the bias
    """
    areas = found.areas
    if is_room and 100 * areas.local > ROOM:
        return False
    if found.original is not None and 100 * abs(found.original) > BIAS:
        return False
    return 100 * areas.smooth <= limits[0] and 100 * abs(areas.bias) <= limits[1]


def has_note(found, words: str) -> bool:
    """Return whether the notes of a bake contain some words."""
    return not words or any(words in note for note in found.notes)


def row(name: str, found, samples: int, good: bool) -> str:
    """Return a row of the table; `good` says if it keeps its limits."""
    figures, areas = found.figures, found.areas
    original = "" if found.original is None else f"{found.original:+.2%}"
    cells = (
        name, f"{figures.rmse:.2%}", f"{figures.smooth:.2%}", f"{figures.bias:+.2%}", f"{figures.noise:.2%}",
        f"{areas.rmse:.2%}", f"{areas.smooth:.2%}", original, f"{figures.edges:.0%}", str(figures.texels),
        str(figures.hidden), str(found.difference.shape[2]), str(samples), _GOOD if good else "**no**",
    )  # fmt: skip
    return f"| {' | '.join(cells)} |"


def write_table(path: Path, rows: list[str], order: list[str], version: str) -> None:
    """Write rows into the table between the marks, scenes in a given order; rows of other scenes stay."""
    text = path.read_text(encoding="utf-8")
    head, _, rest = text.partition(_MARKS[0])
    old, _, tail = rest.partition(_MARKS[1])
    known = {_cells(line)[0]: line for line in (*old.splitlines()[5:], *rows)}
    rows = [known[name] for name in order if name in known]
    head_row, rule = f"| {' | '.join(_TITLES)} |", "|---" * len(_TITLES) + "|"
    lines = [_MARKS[0], f"Blender {version}.", "", head_row, rule, *rows, _MARKS[1]]
    path.write_text(head + "\n".join(lines) + tail, encoding="utf-8")


def _not_baked(name: str, reason: str) -> str:
    """Return the row of a scene without result."""
    return f"| {name} | not baked: {reason} |" + " |" * (len(_TITLES) - 2)


def _row_of(line: str) -> str:
    """Return the row of a line, without the time after it."""
    return line[: line.rindex("|") + 1]


def _misses(line: str) -> bool:
    """Return True for the row of a scene that misses its limits or was not baked."""
    return line.startswith("| ") and _cells(_row_of(line))[-1] != _GOOD


def _cells(row: str) -> list[str]:
    """Return the cells of a row of a table."""
    return [cell.strip() for cell in row.strip().strip("|").split("|")]


if __name__ == "__main__":
    main()
