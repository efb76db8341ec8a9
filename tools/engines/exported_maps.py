"""Metadata of an exported file, and the maps that its manifest assigns to each object."""

from __future__ import annotations

import json
from pathlib import Path


def exported_maps(folder: Path) -> dict[str, dict[str, str]]:
    """Return the files of each object's lightmap and directional maps, by the names of outputs."""
    manifest = json.loads((folder / "hemibake.json").read_text(encoding="utf-8"))
    return {
        shown["object"]: {output.lower().replace(" ", "_"): file for output, file in shown["maps"].items()}
        for shown in manifest["objects"]
    }


def glb_json(path: Path) -> dict:
    """Return the JSON chunk of a .glb file (glTF 2.0, section 4.4)."""
    data = path.read_bytes()
    head: dict = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    return head
