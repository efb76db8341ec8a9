"""One comparison: Hemibake and Cycles bake the open scene."""

from __future__ import annotations

import importlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tools.headless import MODULE, load, quiet_stdout
from tools.verification.areas import bake_areas, subdivided
from tools.verification.cycles import realised
from tools.verification.difference import Difference, compare, weight_of
from tools.verification.doubled import doubled_texels
from tools.verification.originals import original_mean


@dataclass(frozen=True)
class Comparison:
    """Result of a comparison with Cycles.

    figures:          against what Cycles bakes, which is the face at each texel's centre
    areas:            against the mean of what Cycles bakes within each texel
    difference:       (atlases, h, w, 3), that of the figures, relative to the mean
    area_difference:  that of areas
    notes:            of Hemibake's bake
    original:         relative difference of the mean light of an object from Cycles' bake of the user's own
                      object, see `scenes.ORIGINALS`; None without one
    """

    figures: Difference
    areas: Difference
    difference: np.ndarray
    area_difference: np.ndarray
    notes: list[str]
    original: float | None = None


def verify(context, samples: int, original: str | None = None, group: str | None = None) -> Comparison:
    """Compare a bake of the scene's settings with Cycles; `samples` in each texel.

    Objects without lightmap UVs are unwrapped, as in every bake.

    original:  name of an object that Cycles also bakes in the user's scene, which this changes
    group:     name of the light group whose map is compared; None for all light
    """
    engine = importlib.import_module(f"{MODULE}.engine")
    with quiet_stdout():
        read, settings = read_for_bake(context)
        # Cycles leaves seams as they are.
        lightmap = engine.finished(engine.bake(read.scene, replace(settings, hide_seams=False)))
        with realised(context, read, settings.resolution) as reference:
            if group is not None:
                reference.keep_group(group)
            bakes = reference.bake(samples, 1), reference.bake(samples, 2)
            colour = reference.colour()
            covered = None if original is None else reference.covers(original)
        means = bake_areas(context, read, settings, samples, group)
        known = known_texels(lightmap, read.scene, settings)
    light = lightmap.display if group is None else lightmap.passes[f"light_group {group}"]
    figures, difference = compare(light, known, weight_of(colour), bakes)
    areas, area_difference = compare(light, lightmap.known, means.share, means.bakes)
    notes = [*read.notes, *lightmap.report.warnings]
    off = None
    if original is not None:
        with quiet_stdout():
            own = original_mean(context, original, samples)
        off = float((lightmap.display[covered & lightmap.known].mean(axis=0) / own).mean()) - 1
    return Comparison(figures, areas, difference, area_difference, notes, off)


def known_texels(lightmap, scene, settings) -> np.ndarray:
    """Return the texels, (atlases, h, w) bool, whose light can be known.

    They have a patch, are not filled as inside of something, and lie on one surface only.
    """
    visible = lightmap.has_patch & lightmap.known
    return visible & ~doubled_texels(subdivided(scene, settings), len(scene.atlases))


def read_for_bake(context):
    """Make missing lightmap UVs; return the scene that a bake of the context would read, and its settings."""
    scene = importlib.import_module(f"{MODULE}.operators.scene")
    unwrap = importlib.import_module(f"{MODULE}.operators.scene.uvs.unwrap")
    size = importlib.import_module(f"{MODULE}.operators.lightmap_size")
    changes = importlib.import_module(f"{MODULE}.operators.rollback").Rollback()
    settings = importlib.import_module(f"{MODULE}.operators.bake_settings").read_settings(
        context.scene.hemibake
    )
    finished = importlib.import_module(f"{MODULE}.engine.progress").finished
    objects, layer = scene.visible_meshes(context), context.scene.hemibake.uv_layer
    where, resolution = scene.SceneContext(context), settings.resolution
    if context.scene.hemibake.size_mode == "DENSITY":
        resolution = finished(size.choose_width(where, objects, changes)).width
        settings = replace(settings, resolution=resolution)
    made = finished(unwrap.unwrap_missing(where, objects, layer, resolution, changes))
    usable = [obj for obj in objects if obj not in made.skipped]
    return finished(scene.read_scene(where, usable, layer, resolution, made.notes)), settings


def write_difference(difference: np.ndarray, path: Path) -> None:
    """Write a picture: grey is equal, white and black are +-20 % of the mean."""
    atlases = np.concatenate(list(difference), axis=1)
    pictures = load("operators.result.pictures")
    pictures.write_png(np.clip(0.5 + 2.5 * atlases, 0, 1), path)
