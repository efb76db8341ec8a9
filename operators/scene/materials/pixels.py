"""Blender images -> arrays of scene-linear pixels."""

from __future__ import annotations

import bpy
import numpy as np

from ....engine.scene.color import srgb_to_linear

#: Colour spaces whose pixels are scene-linear Rec.709 as they are, and the one that is converted.
_LINEAR = {"Linear Rec.709", "Non-Color", "Raw", "Linear", "Generic Data"}
_SRGB = "sRGB"

#: Luminance of scene-linear Rec.709.
_LUMINANCE = np.array([[0.2126], [0.7152], [0.0722]], np.float32)

#: What Cycles shows for an image that cannot be read.
MISSING = np.array([[[1.0, 0.0, 1.0, 1.0]]], np.float32)


class PixelCache:
    """The pixels of images, each read once."""

    def __init__(self, notes: list[str]) -> None:
        self._notes = notes
        self._images: dict[int, np.ndarray] = {}
        self._parts: dict[tuple[int | None, str], np.ndarray] = {}

    def read_part(self, image: bpy.types.Image | None, owner: str, part: str) -> np.ndarray:
        """Return the "colour" of an image, (h, w, 3) float32 as `read`, or its "alpha" or "grey", (h, w, 1).

        Grey is the luminance, linear. Everyone who asks for a part of an image gets the same array.
        """
        pixels = self.read(image, owner)
        key = (None if image is None else image.session_uid, part)
        if key not in self._parts:
            self._parts[key] = np.ascontiguousarray(_part(pixels, part, is_srgb(image)))
        return self._parts[key]

    def read(self, image: bpy.types.Image | None, owner: str) -> np.ndarray:
        """Return (h, w, 4) float32, colour (see `is_srgb`) and alpha, row 0 at v = 0.

        An image without pixels is magenta, as in Cycles, which is said in the notes; owner names who uses it.
        """
        if image is None:
            self._note(f"{owner} has an image texture without an image: magenta is baked, as in Cycles.")
            return MISSING
        if image.session_uid not in self._images:
            self._images[image.session_uid] = self._load(image, owner)
        return self._images[image.session_uid]

    def _load(self, image: bpy.types.Image, owner: str) -> np.ndarray:
        pixels = np.empty(0, np.float32)
        width, height = image.size
        if width and height:
            pixels = np.empty(width * height * 4, np.float32)
            try:
                image.pixels.foreach_get(pixels)
            except (RuntimeError, TypeError):
                pixels = np.empty(0, np.float32)
        if not pixels.size:
            self._note(
                f"Image '{image.name}', which {owner} uses, cannot be read: magenta is baked, as in Cycles. "
                "Find the file again (File > External Data), or pack it."
            )
            return MISSING
        pixels = pixels.reshape(height, width, 4)
        return np.nan_to_num(pixels, posinf=0.0, neginf=0.0)

    def _note(self, note: str) -> None:
        if note not in self._notes:
            self._notes.append(note)


def _part(pixels: np.ndarray, part: str, srgb: bool) -> np.ndarray:
    """Return a part of (h, w, 4) pixels; see `PixelCache.read_part`."""
    if part == "alpha":
        return pixels[..., 3:]
    colours = pixels[..., :3]
    if part == "grey":
        luminance: np.ndarray = (srgb_to_linear(colours) if srgb else colours) @ _LUMINANCE
        return luminance
    return colours


def is_plain(image: bpy.types.Image | None) -> bool:
    """Return whether an image is one still picture in a colour space that is known here."""
    if image is None:
        return True
    spaces = _LINEAR | ({_SRGB} if not image.is_float else set())
    return image.source in {"FILE", "GENERATED"} and image.colorspace_settings.name in spaces


def is_srgb(image: bpy.types.Image | None) -> bool:
    """Return whether an image's colours are sRGB-encoded, not scene-linear."""
    return image is not None and image.colorspace_settings.name == _SRGB and not image.is_float
