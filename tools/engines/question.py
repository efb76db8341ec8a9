"""Description of a picture that an engine with its own program renders, written to a folder."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from .exported_maps import exported_maps


def ask(
    folder: Path,
    program: Path,
    path: Path,
    size: tuple[int, int],
    hide: tuple[str, ...],
    directional: bool,
    **own: object,
) -> None:
    """Write the input of a render to a folder: exported file, its maps, program source, and show.json.

    program:      copied beside them
    path:         a .glb file without lightmaps in it, with OpenEXR files and hemibake.json beside it
    size:         width and height, pixels
    hide:         names of nodes that are not shown
    directional:  True to shade normal maps with the maps of the output Directional
    own:          what this engine is asked besides
    """
    asked = {
        "file": path.name, "width": size[0], "height": size[1], "hidden": list(hide),
        "directional": directional, "maps": exported_maps(path.parent), **own,
    }  # fmt: skip
    (folder / "show.json").write_text(json.dumps(asked), encoding="utf-8")
    for file in (path, program, *path.parent.glob(f"{path.stem}.*.exr")):
        shutil.copy2(file, folder)
