"""Colours and alpha of images as Cycles' image textures give them, by the alpha mode.

Where colour and alpha belong together (modes Straight and Premultiplied, no data), Cycles keeps colours
multiplied by alpha. The Color output is divided by it only where the Alpha output is linked, too (Cycles,
scene/shader_nodes.cpp, ImageTextureNode; measured in 4.2, 5.0 and 5.2).
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ...compat import multiplies_by_alpha

#: Colour spaces of data: their channels do not depend on alpha.
DATA = frozenset({"Non-Color", "Raw", "Generic Data"})

_ASSOCIATED = frozenset({"STRAIGHT", "PREMUL"})


@dataclass(frozen=True)
class AlphaMeaning:
    """How the channels of pixels depend on alpha.

    associated  colour and alpha belong together
    multiplies  Cycles multiplies colours by alpha; otherwise it takes them for multiplied ones
    """

    associated: bool
    multiplies: bool

    @classmethod
    def of(cls, image: bpy.types.Image) -> AlphaMeaning:
        """Return the meaning for an image."""
        associated = image.alpha_mode in _ASSOCIATED and image.colorspace_settings.name not in DATA
        return cls(associated, multiplies_by_alpha(image))

    def straight(self, pixels: np.ndarray) -> np.ndarray:
        """Return the colours of pixels (..., 4) where Alpha is linked, (..., 3) float32."""
        colours = pixels[..., :3]
        if self.multiplies or not self.associated:
            return colours
        alpha = pixels[..., 3:]
        return colours / np.where(alpha > 0, alpha, 1)

    def multiplied(self, pixels: np.ndarray) -> np.ndarray:
        """Return the colours of pixels (..., 4) where Alpha is not linked, (..., 3) float32."""
        colours = pixels[..., :3]
        return colours * pixels[..., 3:] if self.multiplies and self.associated else colours


def channels_of(image: bpy.types.Image) -> np.ndarray:
    """Return the channels of an image as Cycles reads them, (h w 4,) float32, alpha 1 where it ignores it.

    Cycles reads files by itself, where Blender converts colours by the alpha mode. Raises RuntimeError or
    TypeError if Blender has no pixels.
    """
    channels = _channels(image)
    if image.alpha_mode == "NONE":
        channels[3::4] = 1
    if _is_converted(image) and (channels[3::4] != 1).any():
        copy = image.copy()
        try:
            copy.alpha_mode = "CHANNEL_PACKED"
            unconverted = _channels(copy)
        finally:
            bpy.data.images.remove(copy)
        if unconverted.shape == channels.shape:
            return unconverted
    return channels


def _channels(image: bpy.types.Image) -> np.ndarray:
    channels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(channels)
    return channels


def _is_converted(image: bpy.types.Image) -> bool:
    """Return True if Blender converts colours of an image that Cycles reads from its file."""
    if image.source != "FILE" or image.packed_file is not None or image.is_dirty:
        return False
    mode = "STRAIGHT" if image.is_float else "PREMUL"
    return image.alpha_mode == mode and image.colorspace_settings.name not in DATA
