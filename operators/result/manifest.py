"""The manifest in a folder of lightmaps: origin, encoding and objects of each file.

A folder of lightmaps holds one `hemibake.json`; docs/reference/report_and_manifest.md explains it:

    {"version": 2,
     "lightmaps": {"house_Lightmap.png": {
        "blend": "../house.blend", "scene": "Scene", "atlas": "Lightmap", "output": "combined",
        "objects": [{"object": "Floor", "uv_layer": "Lightmap", "scale": 1.0, "offset": [0.0, 0.0]}],
        "format": "rgbm", "encoding": "PNG, 8-bit RGBM, no colour space",
        "intensity": 34.4932, "decode_texel": "light = ...", "range": 34.4932, "gamma": 2.2,
        "sha256": "...", "replaced": "..."}},
     "objects": [{"object": "Floor", "uv_layer": "Lightmap", "scale": 1.0, "offset": [0.0, 0.0],
        "blend": "../house.blend", "scene": "Scene", "maps": {"combined": "house_Lightmap.png"}}],
     "groups": [{"name": "Lamps", "output": "light_group Lamps"}],
     "states": {"Night": {"Lamps": [1.0, 0.8, 0.6]}}}

`objects` lists the maps of each object of each scene, without files that only Blender shows and files of
light groups that the last bake no longer has, whose "output" is called "superseded". A linked object
has its "library", too: a local one may have the same name. docs/reference/manifest.schema.json describes all
keys.

A file is Hemibake's as long as its bytes are those that were written, `sha256`, or those that it replaced,
`replaced`: a bake may have been killed when the manifest was written and the file was not.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from ...engine.outputs import LIGHT_GROUP

#: File name of the manifest.
NAME = "hemibake.json"

#: Of the layout of the manifest.
VERSION = 2

#: Top-level keys of the manifest that do not describe files: a writer replaces its own keys and keeps the
#: others.
SECTIONS = ("states", "probes", "reflections")


def read_manifest(folder: Path) -> dict[str, dict]:
    """Return the manifest entries of a folder by file; empty if there is no readable manifest."""
    with suppress(KeyError, TypeError, ValueError):
        return dict(_read(folder)["lightmaps"])
    return {}


def read_sections(folder: Path) -> dict[str, dict | list]:
    """Return the sections of a folder's manifest by key; empty if there is no readable manifest."""
    known = _read(folder)
    return {key: known[key] for key in SECTIONS if known.get(key)}


def is_ours(known: dict[str, dict], path: Path, blend: str) -> bool:
    """Return True if Hemibake wrote a file for a .blend and it is unchanged; raises OSError."""
    entry = known.get(path.name)
    if entry is None or entry.get("blend") != blend or not path.is_file():
        return False
    return checksum(path) in (entry.get("sha256"), entry.get("replaced"))


def write_manifest(
    path: Path,
    folder: Path,
    staged: Sequence[Path],
    names: Sequence[str],
    facts: Sequence[dict],
    sections: Mapping[str, dict | list] | None = None,
) -> None:
    """Write the manifest that a folder has once the staged files are renamed into it; raises OSError.

    facts:     entry of each file: "blend", "atlas", "output", "objects", its encoding, and "decode" if a
               formula is needed to use it
    sections:  keys of SECTIONS to replace; an empty value removes the key
    """
    known = {name: entry for name, entry in read_manifest(folder).items() if (folder / name).exists()}
    for new, name, fact in zip(staged, names, facts, strict=True):
        known.pop(name, None)
        sha256 = checksum(new)
        before = checksum(folder / name) if (folder / name).exists() else sha256
        known[name] = {**fact, "sha256": sha256}
        if before != sha256:
            known[name]["replaced"] = before
    _supersede_groups(known, facts)
    written = manifest(known, {**read_sections(folder), **(sections or {})})
    path.write_text(json.dumps(written, indent=1), encoding="utf-8")


def _supersede_groups(known: Mapping[str, dict], facts: Sequence[dict]) -> None:
    """Mark files of light groups that a new bake or export of their lightmap no longer has.

    Their key "output" becomes "superseded", so that they are no longer displayed, and stay files of Hemibake.
    Old entries without a scene belong to that of the new files.

    facts:  entries of all new files
    """
    outputs: dict[tuple, set[str]] = {}
    for fact in facts:
        for key in {_lightmap_key(fact), _lightmap_key({**fact, "scene": None})}:
            outputs.setdefault(key, set()).add(fact.get("output", ""))
    for entry in known.values():
        output, new = entry.get("output", ""), outputs.get(_lightmap_key(entry), set())
        if output.startswith(LIGHT_GROUP) and "combined" in new and output not in new:
            entry["superseded"] = entry.pop("output")


def _lightmap_key(entry: Mapping[str, object]) -> tuple:
    """Return the key of an entry's lightmap, unique among all files, scenes and exports."""
    return tuple(entry.get(key) for key in ("blend", "scene", "export", "atlas"))


def manifest(known: Mapping[str, dict], sections: Mapping[str, dict | list] | None = None) -> dict:
    """Return the contents of a manifest from its file entries and its nonempty sections."""
    optional = {"groups": light_groups(known), **(sections or {})}
    return {
        "version": VERSION,
        "lightmaps": dict(known),
        "objects": _by_object(known),
        **{key: value for key, value in optional.items() if value},
    }


def light_groups(known: Mapping[str, dict]) -> list[dict[str, str]]:
    """Return the light groups of the files of a manifest in the order of the files, with their outputs."""
    outputs = dict.fromkeys(entry.get("output", "") for entry in known.values())
    return [
        {"name": output.removeprefix(LIGHT_GROUP), "output": output}
        for output in outputs
        if output.startswith(LIGHT_GROUP)
    ]


def _read(folder: Path) -> dict:
    """Return the contents of a folder's manifest; empty if there is no readable manifest."""
    with suppress(OSError, ValueError):
        known = json.loads((folder / NAME).read_text(encoding="utf-8"))
        return known if isinstance(known, dict) else {}
    return {}


def _by_object(known: Mapping[str, dict]) -> list[dict]:
    """Return the maps of each object of each scene by output; later files replace earlier ones."""
    found: dict[str, dict] = {}
    for name, entry in known.items():
        owner = {"blend": entry.get("blend"), **({"scene": entry["scene"]} if "scene" in entry else {})}
        is_shown = "output" in entry and "shown_for" not in entry
        for place in entry.get("objects", ()) if is_shown else ():
            key = json.dumps([owner, place], sort_keys=True)
            maps = found.setdefault(key, {**place, **owner, "maps": {}})["maps"]
            maps[entry["output"]] = name
    return list(found.values())


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal; raises OSError."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
