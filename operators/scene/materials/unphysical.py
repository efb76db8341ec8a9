"""Notes on values that bakes replace: reflectance above 1, negative light, NaN and infinity."""

from __future__ import annotations

import bpy
import numpy as np

from .evaluated_passes import Pass, Pixels
from .tree_nodes import used_nodes
from .values import DiffuseSurface

#: Tolerance for rounding.
_ROUNDING = 1e-3

_BRIGHT = (
    "Material '{}' reflects and passes more light than it receives. Bakes reduce the sum to 1. "
    "Darken its colors."
)
_NEGATIVE = "Material '{}' has negative colors or emission, for which 0 is baked. Correct their numbers."


INVALID_VALUES = "Material '{}' gives NaN or infinite values, for which 0 is baked. Correct its nodes."
_INVALID_PIXELS = "Image '{}' has NaN or infinite pixels: 0 is baked there. Repair it."


def invalid_images(material: bpy.types.Material, checked: set[int]) -> list[str]:
    """Return notes on the images of a material that contain NaN or infinity.

    checked:  session uids of images to skip; new ones are added, since a test copies all pixels of an image
    """
    nodes = (getattr(node, "image", None) for node in used_nodes(material.node_tree))
    images = {image for image in nodes if image is not None and image.session_uid not in checked}
    checked |= {image.session_uid for image in images}
    return [_INVALID_PIXELS.format(name) for name in sorted(i.name for i in images if not _is_finite(i))]


def _is_finite(image: bpy.types.Image) -> bool:
    """Return True if all pixels of an image are finite numbers, as in bytes and unchanged Radiance files."""
    is_radiance = image.file_format == "HDR" and image.source == "FILE" and not image.is_dirty
    if not image.is_float or is_radiance:
        return True
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return not pixels.size or bool(np.isfinite(pixels.min()) and np.isfinite(pixels.max()))


def note_surface(name: str, surface: DiffuseSurface, notes: list[str]) -> None:
    """Append notes on the constants of a material's surface, each once."""
    constants = [surface.reflect.constant, surface.transmit.constant, surface.through]
    with np.errstate(invalid="ignore"):
        _note(name, sum(constants), [*constants, surface.emit.constant], notes)


def note_pixels(name: str, pixels: Pixels, notes: list[str]) -> None:
    """Append notes on the pixels that Cycles evaluated for the front of a material, each once.

    pixels:  before `evaluated_passes.finish_passes`
    """
    scattered = [pixels[Pass(each)] for each in ("reflect", "transmit", "through") if Pass(each) in pixels]
    emitted = [pixels[Pass("emit")]] if Pass("emit") in pixels else []
    with np.errstate(invalid="ignore"):
        _note(name, sum(scattered), [*scattered, *emitted], notes)


def _note(name: str, total: np.ndarray | int, values: list[np.ndarray], notes: list[str]) -> None:
    """Append notes if a total exceeds 1, or if a value is negative."""
    found = [(_BRIGHT, np.any(total > 1 + _ROUNDING)), (_NEGATIVE, any((v < 0).any() for v in values))]
    for sentence, applies in found:
        note = sentence.format(name)
        if applies and note not in notes:
            notes.append(note)
