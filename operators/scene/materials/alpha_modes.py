"""Converts image colours by alpha mode, as Cycles' image textures do.

In alpha modes Straight and Premultiplied, Cycles stores colours multiplied by alpha (associated alpha). It
divides the Color output by alpha only if the Alpha output is linked as well. Data images are unaffected.
Source: Cycles, scene/shader_nodes.cpp, ImageTextureNode; measured in 4.2, 5.0 and 5.2.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ...compat import multiplies_by_alpha

#: Colour spaces of data images, whose channels do not depend on alpha.
DATA = frozenset({"Non-Color", "Raw", "Generic Data"})

_ASSOCIATED = frozenset({"STRAIGHT", "PREMUL"})


@dataclass(frozen=True)
class AlphaMeaning:
    """Relation of the colour channels of an image to alpha.

    associated:  True if colour and alpha belong together
    multiplies:  True if Cycles multiplies the colours by alpha; False if it takes them as already multiplied
    """

    associated: bool
    multiplies: bool

    @classmethod
    def of(cls, image: bpy.types.Image) -> AlphaMeaning:
        """Return the alpha meaning of an image."""
        associated = image.alpha_mode in _ASSOCIATED and image.colorspace_settings.name not in DATA
        return cls(associated, multiplies_by_alpha(image))

    def straight(self, pixels: np.ndarray) -> np.ndarray:
        """Return colours for a linked Alpha output, not multiplied by alpha: (..., 4) -> (..., 3) float32."""
        colours = pixels[..., :3]
        if self.multiplies or not self.associated:
            return colours
        alpha = pixels[..., 3:]
        return colours / np.where(alpha > 0, alpha, 1)

    def multiplied(self, pixels: np.ndarray) -> np.ndarray:
        """Return colours for an unlinked Alpha output, multiplied by alpha: (..., 4) -> (..., 3) float32."""
        colours = pixels[..., :3]
        return colours * pixels[..., 3:] if self.multiplies and self.associated else colours


def channels_of(image: bpy.types.Image) -> np.ndarray:
    """Return an image's channels as Cycles reads them, (h w 4,) float32; an ignored alpha is 1.

    Cycles reads image files itself, while Blender converts their colours by alpha mode. Raises RuntimeError
    or TypeError if Blender has no pixels.
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
    """Return True if Blender converts an image file's colours by alpha mode, while Cycles reads the file."""
    if image.source != "FILE" or image.packed_file is not None or image.is_dirty:
        return False
    mode = "STRAIGHT" if image.is_float else "PREMUL"
    return image.alpha_mode == mode and image.colorspace_settings.name not in DATA
