"""In which format lightmaps are written, and after what their files are called."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
from bpy.props import EnumProperty, FloatProperty, StringProperty

from ..engine.encoding.encoding import Encoding, Limits
from ..engine.encoding.half import Half
from ..engine.encoding.logluv import LogLuv
from ..engine.encoding.rgbd import Rgbd
from ..engine.encoding.rgbe import Rgbe
from ..engine.encoding.rgbm import Rgbm
from ..engine.encoding.signed_norm import SignedNorm
from ..engine.encoding.srgb import Srgb
from ..engine.postprocess.outputs import PROJECTED_MAPS, SIGNED_MAPS
from .translations import CONTEXT

#: By name: label and description.
FORMATS = {
    "exr": ("OpenEXR", "Floats, as they are: exact in 32 bits"),
    "hdr": ("Radiance HDR", "Three mantissas and an exponent: off by at most 0.4% of the brightest channel"),
    "png": ("PNG", "sRGB, as pictures have it: light above white is clipped, see Exposure"),
    "rgbm": ("PNG, RGBM", "8-bit colour and multiplier, see Range: for shaders that decode it"),
    "rgbd": ("PNG, RGBD", "8-bit colour and divisor, see Range: for shaders that decode it"),
    "logluv": ("PNG, LogLuv", "Logarithm of the luminance, and chromaticity: for shaders that decode it"),
}

#: Formats that Blender does not show as light: it gets an exact copy, an OpenEXR file beside.
ENCODED = ("png", "rgbm", "rgbd", "logluv")

#: Formats that take a range and a gamma.
RANGED = ("rgbm", "rgbd")

_DEPTHS = {"32": ("Float (Full)", "32 bits a channel"), "16": ("Float (Half)", "16 bits a channel, to 65504")}

_PNG_DEPTHS = {
    "8": ("8", "What every program reads: dark light has visible steps"),
    "16": ("16", "16 bits a channel: no visible steps in light of four decades"),
}

_CODECS = {
    "zip": ("ZIP", "Without loss, 16 rows at a time"),
    "piz": ("PIZ", "Without loss, by wavelets: small where there is noise"),
    "dwaa": ("DWAA", "With loss, by cosines, 32 rows at a time: half floats and the smallest files"),
    "dwab": ("DWAB", "With loss, by cosines, 256 rows at a time: half floats and the smallest files"),
    "none": ("None", "Not compressed"),
}

#: Codecs that store half floats.
_LOSSY = ("dwaa", "dwab")

#: Outputs that are no light: 1 is the most they can be, whatever the exposure.
_FRACTIONS = ("ambient_occlusion", "shadow_mask")

#: Bits of a channel of PNG files of signed maps, whose dark parts share a range with the brightest.
_SIGNED_DEPTH = 16


def format_properties() -> dict:
    """Return the annotations of a group of properties for the files of lightmaps."""
    return {
        "file_name": StringProperty(
            name="Name",
            description="Name of the files, without ending: {file}, {scene}, {lightmap}, {output}, {format} "
            "and {resolution} are replaced. Empty for the .blend's name and the lightmap's, with a number "
            "where that is taken",
        ),
        "file_format": EnumProperty(
            name="Format",
            description="How light is written for engines and other programs",
            translation_context=CONTEXT,
            items=_items(FORMATS),
            default="exr",
        ),
        "exr_depth": EnumProperty(
            name="Color Depth",
            description="Bits of a channel of OpenEXR files",
            items=_items(_DEPTHS),
            default="32",
        ),
        "exr_codec": EnumProperty(
            name="Codec",
            description="How OpenEXR files are compressed",
            items=_items(_CODECS),
            default="zip",
        ),
        "png_depth": EnumProperty(
            name="Color Depth",
            description="Bits of a channel of PNG files",
            items=_items(_PNG_DEPTHS),
            default="8",
        ),
        "exposure": FloatProperty(
            name="Exposure",
            description="Stops that light is raised by before it is written as a picture; white is the most "
            "it can be. Ambient occlusion and shadow masks stay as they are",
            soft_min=-10.0,
            soft_max=10.0,
            min=-60.0,
            max=60.0,
        ),
        "light_range": FloatProperty(
            name="Range",
            description="The brightest light that can be written; 0 for that of the brightest texel. An "
            "engine that decodes with a fixed range demands it here: 34.4932 of Unity, 64 of PlayCanvas "
            "(with a Gamma of 2), 255 of Babylon.js (RGBD)",
            default=0.0,
            min=0.0,
            soft_max=255.0,
            max=1e30,
        ),
        "light_gamma": FloatProperty(
            name="Gamma",
            description="Power of the decoder: more makes dark light finer; 1 is the cheapest to decode",
            default=2.2,
            min=1.0,
            max=4.0,
        ),
    }


def _items(choices: dict[str, tuple[str, str]]) -> list[tuple[str, str, str]]:
    """Return the items of an enumeration."""
    return [(name, label, text) for name, (label, text) in choices.items()]


@dataclass(frozen=True)
class FileFormat:
    """How lightmaps are written.

    name       key of FORMATS
    depth      bits of a channel of OpenEXR
    codec      compression of OpenEXR
    exposure   of PNG, stops
    range      of RGBM and RGBD; 0 for that of the brightest texel
    gamma      of RGBM and RGBD
    png_depth  bits of a channel of PNG
    """

    name: str = "exr"
    depth: int = 32
    codec: str = "zip"
    exposure: float = 0.0
    range: float = 0.0
    gamma: float = 2.2
    png_depth: int = 8

    def of(self, output: str) -> FileFormat:
        """Return the format of a map of an output: signed maps need one that holds both signs.

        Radiance HDR has none: it is OpenEXR then. What is PNG is biased, see `SignedNorm`.
        """
        if output not in SIGNED_MAPS or self.name == "exr":
            return self
        return FileFormat("png", png_depth=_SIGNED_DEPTH) if self.name in ENCODED else PLAIN

    @property
    def label(self) -> str:
        """Its name in the interface."""
        return FORMATS[self.name][0]

    @property
    def endings(self) -> tuple[str, ...]:
        """Endings of a lightmap's files: of the one that Blender shows, then of the one for engines."""
        if self.name in ENCODED:
            return ".exr", ".png"
        return (f".{self.name}",)

    @property
    def shown(self) -> FileFormat:
        """The format of the file that Blender shows."""
        return PLAIN if self.name in ENCODED else self

    @property
    def stores_half(self) -> bool:
        """True for OpenEXR files of 16 bits a channel."""
        return self.name == "exr" and (self.depth == 16 or self.codec in _LOSSY)

    def encoding(self, output: str, brightest: float) -> Encoding | None:
        """Return what makes bytes of the light of an output; None for OpenEXR.

        brightest  of all lightmaps of the output; the largest value of either sign of a signed one
        """
        fraction = output.startswith(_FRACTIONS)
        match self.name:
            case "hdr":
                return Rgbe()
            case "png" if output in SIGNED_MAPS:
                return SignedNorm(1.0 if output in PROJECTED_MAPS else brightest or 1.0, self.png_depth)
            case "png":
                return Srgb(0.0 if fraction else self.exposure, self.png_depth)
            case "logluv":
                return LogLuv()
            case "rgbm" | "rgbd":
                most = 1.0 if fraction else self.range or brightest or 1.0
                return (Rgbm if self.name == "rgbm" else Rgbd)(most, self.gamma)
        return None

    def limits(self, encoding: Encoding | None) -> Limits | None:
        """Return what an encoding of it holds; None if that is all that there is."""
        return Half() if self.stores_half else encoding


#: Every bit of the light.
PLAIN = FileFormat()


def chosen_format(settings: bpy.types.PropertyGroup) -> FileFormat:
    """Return the format that a scene's properties choose."""
    return FileFormat(
        settings.file_format,
        int(settings.exr_depth),
        settings.exr_codec,
        settings.exposure,
        settings.light_range,
        settings.light_gamma,
        int(settings.png_depth),
    )
