"""Format and name of image files of lightmaps, as Blender properties and as a record."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
from bpy.props import EnumProperty, FloatProperty, StringProperty

from ..engine.encoding.encoding import Encoding, Limits
from ..engine.encoding.half import Half
from ..engine.encoding.ktx2 import SharedExponent
from ..engine.encoding.logluv import LogLuv
from ..engine.encoding.rgbd import Rgbd
from ..engine.encoding.rgbe import Rgbe
from ..engine.encoding.rgbm import Rgbm
from ..engine.encoding.signed_norm import SignedNorm
from ..engine.encoding.srgb import Srgb
from ..engine.outputs import PROJECTED_MAPS, SIGNED_MAPS, is_fraction
from .translations import CONTEXT

#: Label and tool-tip of each format, by name.
FORMATS = {
    "exr": ("OpenEXR", "Write floats, exact with 32 bits"),
    "hdr": ("Radiance HDR", "Write RGBE. The error is at most 0.4% of the brightest channel"),
    "ktx2": (
        "KTX2",
        "Write RGB9E5 with mip levels, for GPUs. The error is at most 0.2% of the brightest channel",
    ),
    "png": ("PNG", "Write sRGB pictures. Light above white is clipped, see Exposure"),
    "rgbm": ("PNG, RGBM", "Write an 8-bit color and a multiplier, for shaders that decode RGBM"),
    "rgbd": ("PNG, RGBD", "Write an 8-bit color and a divisor, for shaders that decode RGBD"),
    "logluv": ("PNG, LogLuv", "Write log luminance and chromaticity, for shaders that decode LogLuv"),
}

#: Formats whose pixels Blender cannot decode; the scene shows an additional OpenEXR file instead.
ENCODED = ("ktx2", "png", "rgbm", "rgbd", "logluv")

#: Floating-point formats that store no negative values.
_UNSIGNED = ("hdr", "ktx2")

#: Formats with the settings Range and Gamma.
RANGED = ("rgbm", "rgbd")

_DEPTHS = {
    "32": ("Float (Full)", "Use 32 bits per channel"),
    "16": ("Float (Half)", "Use 16 bits per channel, at most 65504"),
}

_PNG_DEPTHS = {
    "8": ("8", "Use 8 bits per channel, which all programs read. Dark light has visible steps"),
    "16": ("16", "Use 16 bits per channel, without visible steps over four decades of light"),
}

_CODECS = {
    "zip": ("ZIP", "Compress 16 rows at a time, lossless"),
    "piz": ("PIZ", "Compress by wavelets, lossless. Small files for noisy images"),
    "dwaa": ("DWAA", "Compress half floats with loss, 32 rows at a time. Smallest files"),
    "dwab": ("DWAB", "Compress half floats with loss, 256 rows at a time. Smallest files"),
    "none": ("None", "Write uncompressed data"),
}

#: Codecs that store half floats.
_LOSSY = ("dwaa", "dwab")

#: Bits per channel of PNG files of signed maps: 8 bits would show steps in dark parts.
_SIGNED_DEPTH = 16


def format_properties() -> dict:
    """Return the annotations of a property group for the files of lightmaps."""
    return {
        "file_name": StringProperty(
            name="Name",
            description="File name with {file}, {scene}, {lightmap}, {output}, {format}, {resolution}; empty "
            "is automatic",
        ),
        "file_format": EnumProperty(
            name="Format",
            description="Choose the file format for engines and other programs",
            translation_context=CONTEXT,
            items=_items(FORMATS),
            default="exr",
        ),
        "exr_depth": EnumProperty(
            name="Color Depth",
            description="Choose the bits per channel of OpenEXR files",
            items=_items(_DEPTHS),
            default="32",
        ),
        "exr_codec": EnumProperty(
            name="Codec",
            description="Choose the compression of OpenEXR files",
            items=_items(_CODECS),
            default="zip",
        ),
        "png_depth": EnumProperty(
            name="Color Depth",
            description="Choose the bits per channel of PNG files",
            items=_items(_PNG_DEPTHS),
            default="8",
        ),
        "exposure": FloatProperty(
            name="Exposure",
            description="Brighten light by this number of stops before it is written. White clips",
            soft_min=-10.0,
            soft_max=10.0,
            min=-60.0,
            max=60.0,
        ),
        "light_range": FloatProperty(
            name="Range",
            description="Set the brightest value; 0 uses the brightest texel. Unity 34.4932, PlayCanvas 64, "
            "Babylon.js 255",
            default=0.0,
            min=0.0,
            soft_max=255.0,
            max=1e30,
        ),
        "light_gamma": FloatProperty(
            name="Gamma",
            description="Set the exponent of the decoder. More gives finer dark light, PlayCanvas uses 2",
            default=2.2,
            min=1.0,
            max=4.0,
        ),
    }


def _items(choices: dict[str, tuple[str, str]]) -> list[tuple[str, str, str]]:
    """Return the items of a Blender enumeration from labels and tool-tips."""
    return [(name, label, text) for name, (label, text) in choices.items()]


@dataclass(frozen=True)
class FileFormat:
    """Format of the image files of lightmaps.

    name       key of FORMATS
    depth      bits per channel of OpenEXR
    codec      compression of OpenEXR, a key of _CODECS
    exposure   exposure of PNG, stops
    range      brightest value of RGBM and RGBD; 0 for the value of the brightest texel
    gamma      exponent of the decoder of RGBM and RGBD
    png_depth  bits per channel of PNG
    """

    name: str = "exr"
    depth: int = 32
    codec: str = "zip"
    exposure: float = 0.0
    range: float = 0.0
    gamma: float = 2.2
    png_depth: int = 8

    def of(self, output: str) -> FileFormat:
        """Return the format for maps of an output.

        Signed maps (directional ones) are written as 16-bit PNG with a bias, see `SignedNorm`, or as OpenEXR
        instead of Radiance HDR and KTX2, which store no negative values.
        """
        if output not in SIGNED_MAPS or self.name == "exr":
            return self
        return PLAIN if self.name in _UNSIGNED else FileFormat("png", png_depth=_SIGNED_DEPTH)

    @property
    def label(self) -> str:
        """Name of the format in the interface."""
        return FORMATS[self.name][0]

    @property
    def endings(self) -> tuple[str, ...]:
        """File endings of a lightmap: of the displayed file, and of the file for engines if it differs."""
        if self.name in ENCODED:
            return ".exr", ".ktx2" if self.name == "ktx2" else ".png"
        return (f".{self.name}",)

    @property
    def shown(self) -> FileFormat:
        """Format of the file that Blender displays: OpenEXR for encodings that Blender cannot decode."""
        return PLAIN if self.name in ENCODED else self

    @property
    def stores_half(self) -> bool:
        """True if the files are OpenEXR with 16 bits per channel."""
        return self.name == "exr" and (self.depth == 16 or self.codec in _LOSSY)

    def encoding(self, output: str, brightest: float) -> Encoding | None:
        """Return the encoder of pixels of an output; None for OpenEXR, which Blender writes.

        brightest  largest absolute value of all lightmaps of the output
        """
        fraction = is_fraction(output)
        match self.name:
            case "hdr":
                return Rgbe()
            case "ktx2":
                return SharedExponent()
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
        """Return the value range of files with this encoding; None if it is unlimited."""
        return Half() if self.stores_half else encoding


#: Lossless format: OpenEXR with 32 bits per channel.
PLAIN = FileFormat()


def chosen_format(settings: bpy.types.PropertyGroup) -> FileFormat:
    """Return the format that is set in a scene's properties."""
    return FileFormat(
        name=settings.file_format,
        depth=int(settings.exr_depth),
        codec=settings.exr_codec,
        exposure=settings.exposure,
        range=settings.light_range,
        gamma=settings.light_gamma,
        png_depth=int(settings.png_depth),
    )
