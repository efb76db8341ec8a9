"""Writes lightmaps as 8-bit pictures for viewing."""

from __future__ import annotations

import os
from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import bpy
import numpy as np

from ...engine.scene.color import linear_to_srgb
from ..working_space import to_rec709
from .destination import blend_from
from .files import replace_all, staging_folder
from .manifest import NAME, is_ours, read_manifest, write_manifest

#: Color space of images without colors, if the working space is not Rec.709.
DATA = "Non-Color"


def write_pictures(images: Sequence[bpy.types.Image], folder: Path) -> list[str]:
    """Write a picture of each lightmap beside its file and return the paths; raises OSError or RuntimeError.

    The manifest lists the pictures, so that the next bake replaces them. Other files of the same name are
    kept, and the picture gets a number.
    """
    shown = [Path(image.filepath).name for image in images]
    names = [_free_name(folder, Path(name).stem) for name in shown]
    with staging_folder(folder) as staging:
        staged = [staging / f"{index}.png" for index in range(len(names))]
        for image, path in zip(images, staged, strict=True):
            write_png(exposed(rec709_pixels(image)), path)
        facts = [{"blend": blend_from(folder), "picture_of": name} for name in shown]
        write_manifest(staging / NAME, folder, staged, names, facts)
        replace_all([staging / NAME, *staged], [folder / name for name in (NAME, *names)], staging)
    return [str(folder / name) for name in names]


def _free_name(folder: Path, stem: str) -> str:
    """Return a name for a picture that does not replace a file of another origin."""
    known, blend = read_manifest(folder), blend_from(folder)
    numbers = chain([""], (f".{count:03d}" for count in range(1, 10**6)))
    names = (f"{stem}{number}.png" for number in numbers)
    paths = (folder / name for name in names)
    return next(path.name for path in paths if not os.path.lexists(path) or is_ours(known, path, blend))


def read_pixels(image: bpy.types.Image) -> np.ndarray:
    """Return an image's colours in the working space, (h, w, 3) float32, first row at the bottom."""
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(*reversed(image.size), -1)[..., :3]


def holds_colours(image: bpy.types.Image) -> bool:
    """Return True if Blender converts the pixels of a lightmap image to its working space."""
    return image.colorspace_settings.name != DATA


def rec709_pixels(image: bpy.types.Image) -> np.ndarray:
    """Return the light of a lightmap image, (h, w, 3) float32, linear Rec.709; data maps stay unchanged."""
    pixels = read_pixels(image)
    return to_rec709(pixels) if holds_colours(image) else pixels


def exposed(pixels: np.ndarray) -> np.ndarray:
    """Convert linear Rec.709 colours to sRGB in [0, 1].

    The exposure makes the 99th percentile of the largest channel of all texels that are not black white.
    Brighter texels are clipped.
    """
    brightness = pixels.max(axis=-1)
    lit = brightness[brightness > 0]
    return linear_to_srgb(np.clip(pixels / np.percentile(lit, 99) if len(lit) else pixels, 0, 1))


def write_png(pixels: np.ndarray, path: Path) -> None:
    """Write sRGB colours, (h, w, 3) in [0, 1], first row at the bottom, as an 8-bit PNG."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("picture", width, height, alpha=False)
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = pixels
    image.pixels.foreach_set(rgba.reshape(-1))
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)
