"""One comparison: Hemibake bakes the scene that is open, then Cycles."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from tools.headless import MODULE, load, quiet_stdout
from tools.verification.cycles import realised
from tools.verification.difference import Difference, compare
from tools.verification.doubled import doubled_texels


def verify(context, samples: int) -> tuple[Difference, np.ndarray, list[str]]:
    """Return the figures, the picture of the difference and the notes of Hemibake's bake.

    The settings are the scene's. Objects without lightmap UVs are unwrapped, as in every bake.
    """
    engine = importlib.import_module(f"{MODULE}.engine")
    with quiet_stdout():
        read, settings = read_for_bake(context)
        # Cycles leaves seams as they are.
        lightmap = engine.finished(engine.bake(read.scene, replace(settings, hide_seams=False)))
        with realised(context, read, settings.resolution) as reference:
            bakes = reference.bake(samples, 1), reference.bake(samples, 2)
            colour = reference.colour()

    known = known_texels(lightmap, read.scene, settings)
    figures, difference = compare(lightmap.display, known, colour, bakes)
    return figures, difference, [*read.notes, *lightmap.report.warnings]


def known_texels(lightmap, scene, settings) -> np.ndarray:
    """Return the texels, (atlases, h, w) bool, whose light can be known.

    They have a patch, are not filled as inside of something, and lie on one surface only.
    """
    visible = lightmap.has_patch & lightmap.known
    return visible & ~doubled_texels(_subdivided(scene, settings), len(scene.atlases))


def _subdivided(scene, settings):
    """Return the patches of a scene as a bake has them."""
    engine = importlib.import_module(f"{MODULE}.engine")
    names = ("device.graphics", "patches.occluders", "patches.subdivision")
    graphics, occluders, subdivision = (
        importlib.import_module(f"{engine.__name__}.{name}") for name in names
    )
    context = graphics.Graphics()
    try:
        placed = occluders.place_occluders(scene, settings.resolution)
        return subdivision.subdivide(context, placed, settings)
    finally:
        context.release()


def read_for_bake(context):
    """Return what a bake of the context's scene reads, and its settings; missing lightmap UVs are made."""
    scene = importlib.import_module(f"{MODULE}.operators.scene")
    unwrap = importlib.import_module(f"{MODULE}.operators.scene.uvs.unwrap")
    changes = importlib.import_module(f"{MODULE}.operators.changes").Changes()
    settings = importlib.import_module(f"{MODULE}.operators.bake_settings").read_settings(
        context.scene.hemibake
    )
    finished = importlib.import_module(f"{MODULE}.engine.progress").finished
    objects, layer = scene.visible_meshes(context), context.scene.hemibake.uv_layer
    where, resolution = scene.SceneContext(context), settings.resolution
    made = finished(unwrap.unwrap_missing(where, objects, layer, resolution, changes))
    usable = [obj for obj in objects if obj not in made.skipped]
    return finished(scene.read_scene(where, usable, layer, resolution, made.notes)), settings


def write_difference(difference: np.ndarray, path: Path) -> None:
    """Write a picture: grey is equal, white and black are +-20 % of the mean."""
    atlases = np.concatenate(list(difference), axis=1)
    pictures = load("operators.command_line.pictures")
    pictures.write_png(np.clip(0.5 + 2.5 * atlases, 0, 1), path)
