"""Lightmaps as pictures a person can look at."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from ...engine.scene.color import linear_to_srgb


def read_pixels(image: bpy.types.Image) -> np.ndarray:
    """Return an image's colours, (h, w, 3) float32, bottom row first."""
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(*reversed(image.size), -1)[..., :3]


def exposed(pixels: np.ndarray) -> np.ndarray:
    """Return scene-linear colours as sRGB in [0, 1].

    Exposure: the 99th percentile of the brightest channel of all texels that are not black becomes
    white; what is brighter is clipped.
    """
    brightness = pixels.max(axis=-1)
    lit = brightness[brightness > 0]
    return linear_to_srgb(np.clip(pixels / np.percentile(lit, 99) if len(lit) else pixels, 0, 1))


def write_png(pixels: np.ndarray, path: Path) -> None:
    """Write sRGB colours, (h, w, 3) in [0, 1], bottom row first, as an 8-bit picture."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("picture", width, height, alpha=False)
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = pixels
    image.pixels.foreach_set(rgba.reshape(-1))
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)
