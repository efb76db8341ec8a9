"""Reads Blender images as pixel arrays."""

from __future__ import annotations

import bpy
import numpy as np

from ....engine.scene.color import linear_to_srgb, luminance, srgb_to_linear
from ....engine.scene.texture import Texture
from ...lookup import find
from ...working_space import from_rec709, is_rec709, luminance_of
from ..slice_timer import Slices, row_slices
from .alpha_modes import DATA, AlphaMeaning, channels_of
from .clear_pixels import fill_clear
from .normal_map_tilts import CLASSES, count_tilts, image_state, kept_tilts

#: Blender's names of color spaces with linear values, and of the sRGB color space.
_LINEAR = {"Linear Rec.709", "Non-Color", "Raw", "Linear", "Generic Data"}
_SRGB = "sRGB"

#: Magenta pixel that Cycles shows for an image that cannot be read.
MISSING = np.array([[[1.0, 0.0, 1.0, 1.0]]], np.float32)


#: Images of more floats than this are announced before they are read, as are images that are not loaded yet.
_LARGE = 1 << 22


class PixelsNeededError(Exception):
    """Raised if pixels are requested that have not been read yet.

    reading:  slices of work that read them; a second request then succeeds
    """

    def __init__(self, reading: Slices[None]) -> None:
        super().__init__()
        self.reading = reading


class PixelCache:
    """The pixels of images, each read once.

    notes:  sentences for the user are appended here
    """

    def __init__(self, notes: list[str]) -> None:
        self._notes = notes
        self._images: dict[int, np.ndarray] = {}
        self._parts: dict[tuple[int, str], np.ndarray] = {}
        self._filled: dict[tuple[int, int, float], np.ndarray] = {}
        self._tilts: dict[int, np.ndarray] = {}

    def read_part(self, image: bpy.types.Image | None, owner: str, part: str) -> np.ndarray:
        """Return one part of an image: "colour", (h, w, 3) float32, or "alpha" or "grey", (h, w, 1) float32.

        Colours are in the working space, sRGB-encoded if `is_srgb`. Grey is the linear luminance.
        "colour * alpha" and "grey * alpha" are the values that Cycles uses if the Alpha output is not linked,
        see `alpha_modes`. Each request for the same part returns the same array. Raises PixelsNeededError if
        the image must be read first.
        """
        if image is None:
            return _part(self.read(image, owner), part, False, AlphaMeaning(False, False), True)
        key = (image.session_uid, part)
        if key not in self._parts:
            meaning = AlphaMeaning.of(image)
            reading = self._read_part(key, owner, is_srgb(image), meaning, _is_scene_linear(image))
            raise PixelsNeededError(reading)
        return self._parts[key]

    def fill_clear(self, texture: Texture, opacity: np.ndarray, least: float) -> np.ndarray:
        """Return pixels, (h, w, c) float32, whose clear ones have the mean colour of opaque ones around.

        Raises PixelsNeededError if they must be filled first.

        texture:  its pixels are a part of an image
        opacity:  part of an image, (h, w, 1) float32
        least:    smallest opacity of opaque pixels
        """
        pixels = texture.pixels
        is_opaque = opacity[..., 0] >= least
        if is_opaque.all() or not is_opaque.any():
            return pixels
        key = id(pixels), id(opacity), least
        if key not in self._filled:
            raise PixelsNeededError(self._fill_clear(key, texture, is_opaque))
        return self._filled[key]

    def _fill_clear(
        self, key: tuple[int, int, float], texture: Texture, is_opaque: np.ndarray
    ) -> Slices[None]:
        self._filled[key] = yield from fill_clear(texture.pixels, is_opaque, texture.srgb)

    def read(self, image: bpy.types.Image | None, owner: str) -> np.ndarray:
        """Return colour (see `is_srgb`, `AlphaMeaning`) and alpha, (h, w, 4) float32, first row at v = 0.

        An image without pixels is magenta, as in Cycles, and a note says so. Raises PixelsNeededError if the
        image must be read first.

        owner:  name of the datablock in notes
        """
        if image is None:
            self._note(f"{owner} has an image texture without an image: magenta is baked, as in Cycles.")
            return MISSING
        if image.session_uid not in self._images:
            raise PixelsNeededError(self._read(image.session_uid, owner))
        return self._images[image.session_uid]

    def read_tilts(self, image: bpy.types.Image, owner: str) -> np.ndarray:
        """Return the histogram of a normal map's tilts, (CLASSES,) int64, see `count_tilts`.

        Raises PixelsNeededError if the image must be read first.

        owner:  name of the datablock in notes
        """
        uid = image.session_uid
        if uid not in self._tilts:
            state = image_state(image)
            counts = kept_tilts.get(state)
            if counts is None:
                raise PixelsNeededError(self._read_tilts(uid, state, owner, is_srgb(image)))
            self._tilts[uid] = counts
        return self._tilts[uid]

    def _read_tilts(self, uid: int, state: tuple | None, owner: str, srgb: bool) -> Slices[None]:
        """Compute a normal map's histogram of tilts.

        Its pixels are cached afterwards only if they were before.
        """
        known = uid in self._images
        if not known:
            yield from self._read(uid, owner)
        pixels, counts = self._images[uid], np.zeros(CLASSES, np.int64)
        if not known:
            del self._images[uid]
        for rows in row_slices(len(pixels), pixels.shape[1] * 4):
            counts += count_tilts(pixels[rows, :, :3], srgb)
            yield rows.stop / len(pixels)
        self._tilts[uid] = counts
        kept_tilts.keep(state, counts)

    def _read_part(
        self, key: tuple[int, str], owner: str, srgb: bool, meaning: AlphaMeaning, scene_linear: bool
    ) -> Slices[None]:
        uid, part = key
        if uid not in self._images:
            yield from self._read(uid, owner)
        pixels = self._images[uid]
        made = np.empty((*pixels.shape[:2], 3 if part.startswith("colour") else 1), np.float32)
        for rows in row_slices(len(pixels), pixels.shape[1] * 4):
            made[rows] = _part(pixels[rows], part, srgb, meaning, scene_linear)
            yield rows.stop / len(pixels)
        self._parts[key] = made

    def _read(self, uid: int, owner: str) -> Slices[None]:
        image = find(bpy.data.images, uid)
        if image is not None and (not image.has_data or image.size[0] * image.size[1] * 4 > _LARGE):
            yield f"Reading image '{image.name}'"
            image = find(bpy.data.images, uid)
        pixels = MISSING if image is None else self._load(image, owner)
        for rows in row_slices(len(pixels), pixels.shape[1] * 4):
            if not np.isfinite(pixels[rows]).all():
                np.nan_to_num(pixels[rows], copy=False, posinf=0.0, neginf=0.0)
                self._note(
                    f"An image of {owner} has NaN or infinite pixels: black is baked there. Repair it."
                )
            yield rows.stop / len(pixels)
        self._images[uid] = pixels

    def _load(self, image: bpy.types.Image, owner: str) -> np.ndarray:
        """Return the channels of an image, (h, w, 4) float32; magenta with a note if it cannot be read."""
        pixels = np.empty(0, np.float32)
        width, height = image.size
        if width and height:
            try:
                pixels = channels_of(image)
            except (RuntimeError, TypeError):
                pixels = np.empty(0, np.float32)
        if not pixels.size:
            self._note(
                f"Image '{image.name}', which {owner} uses, cannot be read: magenta is baked, as in Cycles. "
                "Find the file again (File > External Data), or pack it."
            )
            return MISSING.copy()
        return pixels.reshape(height, width, 4)

    def _note(self, note: str) -> None:
        if note not in self._notes:
            self._notes.append(note)


def _part(pixels: np.ndarray, part: str, srgb: bool, meaning: AlphaMeaning, scene_linear: bool) -> np.ndarray:
    """Return one part of pixels, (h, w, 4) float32; see `PixelCache.read_part`.

    scene_linear:  True if the pixels are in the working space; otherwise they are Rec.709
    """
    if part == "alpha":
        return pixels[..., 3:]
    colours = meaning.multiplied(pixels) if part.endswith("* alpha") else meaning.straight(pixels)
    if part.startswith("grey"):
        linear = srgb_to_linear(colours) if srgb else colours
        return (luminance_of(linear) if scene_linear else luminance(linear))[..., None]
    if scene_linear or is_rec709():
        return colours
    return linear_to_srgb(from_rec709(srgb_to_linear(colours))) if srgb else from_rec709(colours)


def _is_scene_linear(image: bpy.types.Image) -> bool:
    """Return True if pixels are in the working space, not in Rec.709: float images, data as colour."""
    return bool(image.is_float) or image.colorspace_settings.name in DATA


def is_plain(image: bpy.types.Image | None) -> bool:
    """Return whether an image is a single still picture in a known colour space."""
    if image is None:
        return True
    spaces = _LINEAR | ({_SRGB} if not image.is_float else set())
    return image.source in {"FILE", "GENERATED"} and image.colorspace_settings.name in spaces


def is_srgb(image: bpy.types.Image | None) -> bool:
    """Return whether an image's colours are sRGB-encoded, not linear."""
    return image is not None and image.colorspace_settings.name == _SRGB and not image.is_float
