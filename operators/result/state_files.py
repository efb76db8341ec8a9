"""Files of a light state: one plain lightmap for each lightmap that has maps of light groups."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np

from ...engine.errors import EngineError
from ..file_format import chosen_format
from ..rollback import Rollback
from ..working_space import to_rec709
from .destination import Destination, choose_destination, is_of_another_scene
from .files import reason
from .images import write_all
from .light_mixer import group_images
from .light_states import factors, manifest_states, mixed_light
from .lightmap_files import lightmap_files
from .manifest import read_manifest
from .pictures import read_pixels

#: Prefix of the names of light states as outputs.
STATE = "state "


def write_state(scene: bpy.types.Scene, state: bpy.types.PropertyGroup) -> list[Path]:
    """Write the mix of a light state as plain lightmaps in the scene's folder and format.

    Returns the paths of the files. Raises EngineError if there are no maps of light groups, no folder, or a
    file cannot be written; old files then stay.
    """
    mixed = _mixed(scene, factors(state))
    if not mixed:
        raise EngineError(
            f"Scene '{scene.name}': no maps of light groups. Bake the output Light Groups first."
        )
    output, changes = f"{STATE}{state.name}", Rollback()
    formats = [chosen_format(scene.hemibake)] * len(mixed)
    names = [f"{atlas} {output}" for atlas in mixed]
    try:
        chosen = choose_destination(scene, names, scene.hemibake.directory, changes, formats)
        if chosen.folder is None:
            raise EngineError(f"State '{state.name}': the .blend has no folder. Save the .blend first.")
        return _write(scene, chosen, output, mixed)
    except EngineError:
        changes.undo()
        raise


def _mixed(scene: bpy.types.Scene, weights: dict[str, list[float]]) -> dict[str, np.ndarray]:
    """Return the mix of the light groups of each lightmap that has their maps, linear Rec.709, by atlas.

    weights:  scene-linear factor of each group
    """
    found = {}
    for entry in scene.hemibake.lightmaps:
        if entry.image is not None and not entry.companion_of:
            images = group_images(scene, [entry.image])
            if images:
                maps = {name: read_pixels(image) for name, (image,) in images.items()}
                found[entry.name] = to_rec709(mixed_light(maps, weights))
    return found


def _write(
    scene: bpy.types.Scene, destination: Destination, output: str, mixed: dict[str, np.ndarray]
) -> list[Path]:
    """Write the lightmaps of a state, one by one, since their sizes may differ; raises EngineError."""
    folder = destination.folder
    assert folder is not None
    known, paths = read_manifest(folder), list[Path]()
    for number, (atlas, light) in enumerate(mixed.items()):
        one = slice(number, number + 1)
        part = replace(destination, stems=destination.stems[one], formats=destination.formats[one])
        facts = {"atlas": atlas, "output": output, "objects": _objects(known, atlas, destination)}
        files = list(lightmap_files(light[None], part, [facts]))
        try:
            write_all(files, part, manifest_states(scene))
        except (OSError, RuntimeError) as error:
            raise EngineError(
                f"The lightmaps of '{output}' cannot be written to '{part.folder}': {reason(error)}. Choose "
                "another folder."
            ) from error
        paths += [folder / file.name for file in files]
    return paths


def _objects(known: dict[str, dict], atlas: str, destination: Destination) -> list[dict]:
    """Return the manifest's objects of an atlas as its bake wrote them; empty without its files."""
    entries = (
        entry["objects"]
        for entry in known.values()
        if entry.get("atlas") == atlas and entry.get("blend") == destination.blend
        if "export" not in entry and not is_of_another_scene(entry, destination.scene)
    )
    return next(entries, [])
