"""The Cornell box, baked, in Blender's preview: what engines have to show."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]

#: The wall that the camera looks through: glTF knows no visibility to cameras.
HIDDEN = ("Front Wall",)


def bake(resolution: int = 192, quality: str = "high") -> None:
    """Build the box in an empty file and bake it."""
    import bpy

    sys.path.insert(0, str(ROOT / "examples"))
    import cornell_box

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    cornell_box.build()
    settings = bpy.context.scene.hemibake
    settings.quality, settings.resolution = quality, resolution
    bpy.ops.hemibake.bake()


def preview(width: int, folder: Path) -> np.ndarray:
    """Return the preview as Cycles renders it, (width, width, 3) float32, linear, bottom row first.

    Surfaces only emit, and a filter that is almost a point samples the middle of each pixel, as engines do.
    """
    import bpy

    scene, path = bpy.context.scene, folder / "preview.exr"
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", 1
    scene.cycles.max_bounces, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 0, False, False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 0.01
    scene.render.resolution_x = scene.render.resolution_y = width
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(path)
    bpy.ops.hemibake.preview()
    bpy.ops.render.render(write_still=True)
    bpy.ops.hemibake.preview()
    image = bpy.data.images.load(str(path))
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(width, width, -1)[..., :3]


def differences(shown: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return how far each pixel is off, (n,), of its brightest channel, where anything is shown."""
    brightest = wanted.max(axis=-1)
    lit = brightest > 0
    return np.abs(shown - wanted).max(axis=-1)[lit] / brightest[lit]
