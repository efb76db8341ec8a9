"""Merges reports and manifests of separately baked parts: `blender -b -c hemibake_merge FOLDER`.

Each part has its own folder in FOLDER, with the report of `--report` beside its lightmaps:

    FOLDER/hall/report.json    FOLDER/hall/hemibake.json    FOLDER/hall/hall_Lightmap.exr
    FOLDER/yard/report.json    ...
    FOLDER/report.json and FOLDER/hemibake.json are written
"""

from __future__ import annotations

import argparse
import json
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from ..result.manifest import NAME, manifest, read_manifest, read_sections
from .options import CommandError, Parser
from .signals import Signals

#: File name of the report of a part, and of the merged report.
REPORT = "report.json"


def merge_parser(program: str) -> Parser:
    """Return a parser for the options of a merge."""
    made = Parser(
        prog=program,
        description="Merge the reports and manifests of parts that were baked into folders of one folder.",
    )
    made.add_argument("folder", type=Path, help="that holds the folders of the parts")
    made.add_argument("--parts", nargs="+", metavar="NAME", help="names of the folders; all by default")
    made.add_argument("--json", action="store_true", help="end with one JSON object")
    return made


def merge_parts(options: argparse.Namespace, _: Signals) -> dict:
    """Merge the parts of a folder, write the report and the manifest, and return the report.

    Raises CommandError if a part has no readable report, and OSError if a file cannot be written.
    """
    folder, parts = options.folder.resolve(), options.parts
    names = sorted(path.parent.name for path in folder.glob(f"*/{REPORT}")) if parts is None else list(parts)
    if not names:
        raise CommandError(
            f"No folder in '{folder}' holds a {REPORT}: bake each part with --out {folder / 'PART'} "
            f"--report {folder / 'PART' / REPORT}."
        )
    reports = {name: _read(folder / name / REPORT) for name in names}
    whole = _sum(reports)
    _write(folder / NAME, manifest(_lightmaps(folder, names), _sections(folder, names)))
    _write(folder / REPORT, whole)
    return whole


def _read(path: Path) -> dict:
    try:
        report = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise CommandError(
            f"Part '{path.parent.name}' has no report; bake that part first: {error}"
        ) from error
    except ValueError as error:
        raise CommandError(f"'{path}' is not a bake report: {error}. Bake that part again.") from error
    if not isinstance(report, dict) or not report.keys() >= _TOTALS:
        raise CommandError(f"'{path}' is not a bake report. Bake that part again.")
    return report


#: Entries that each part's report must have.
_TOTALS = {"objects", "patches", "iterations", "seconds", "files", "warnings"}


def _sum(reports: dict[str, dict]) -> dict:
    """Return the merged report: sums, maximum of iterations, files, warnings, and all parts by name."""
    seconds: Counter[str] = Counter()
    for report in reports.values():
        seconds.update(report["seconds"])
    return {
        "objects": sum(report["objects"] for report in reports.values()),
        "patches": sum(report["patches"] for report in reports.values()),
        "iterations": max(report["iterations"] for report in reports.values()),
        "seconds": dict(seconds),
        "files": [file for report in reports.values() for file in report["files"]],
        "warnings": [
            f"{name}: {warning}" for name, report in reports.items() for warning in report["warnings"]
        ],
        "parts": reports,
    }


def _lightmaps(folder: Path, names: Sequence[str]) -> dict[str, dict]:
    """Return the manifest entries of all parts, by file paths relative to the folder."""
    return {
        f"{name}/{file}": {**entry, **_moved(entry, name)}
        for name in names
        for file, entry in read_manifest(folder / name).items()
    }


def _sections(folder: Path, names: Sequence[str]) -> dict[str, dict | list]:
    """Return states, probes and reflections of all parts; of states with one name the last part's is kept."""
    states: dict[str, dict] = {}
    lists: dict[str, list[dict]] = {"probes": [], "reflections": []}
    for name in names:
        known = read_sections(folder / name)
        states |= dict(known.get("states", {}))
        for key, entries in lists.items():
            entries += [_with_paths(entry, name) for entry in known.get(key, [])]
    return {"states": states, **lists}


def _with_paths(entry: dict, name: str) -> dict:
    """Return a probe's entry with the paths of its files relative to the folder of all parts."""
    moved = dict(entry)
    moved |= {key: f"{name}/{entry[key]}" for key in ("file", "ktx2") if key in entry}
    if "groups" in entry:
        moved["groups"] = [{**group, "file": f"{name}/{group['file']}"} for group in entry["groups"]]
    if "distances" in entry:
        known = entry["distances"]
        moved["distances"] = {**known, **{key: f"{name}/{known[key]}" for key in ("file", "offsets")}}
    if "files" in entry:
        moved["files"] = [f"{name}/{file}" for file in entry["files"]]
    return moved


def _moved(entry: dict, name: str) -> dict:
    """Return the path of a part's .blend relative to the folder; empty if it was never saved."""
    blend = entry.get("blend") or ""
    relative = blend and not os.path.isabs(blend)
    return {"blend": Path(os.path.normpath(Path(name, blend))).as_posix()} if relative else {}


def _write(path: Path, facts: dict) -> None:
    """Replace a file by JSON in one step."""
    staged = path.with_suffix(".part")
    staged.write_text(json.dumps(facts, indent=1), encoding="utf-8")
    staged.replace(path)
