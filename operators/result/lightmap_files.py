"""Lightmap files: contents, encoding and manifest entry of each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...engine.encoding.encoding import Encoding, encode_in_bands
from ...engine.encoding.ktx2 import ktx2_texture
from ...engine.encoding.png import png_bytes
from ...engine.encoding.radiance import radiance_bytes
from ...engine.encoding.signed_norm import SignedNorm
from ...engine.encoding.srgb import Srgb
from ...engine.outputs import RATIO_MAPS
from ...engine.postprocess.chart_mips import chart_mips
from ..file_format import FileFormat
from .destination import Destination
from .exr import write_exr


@dataclass(frozen=True)
class LightmapFile:
    """File of a lightmap.

    name:      file name with extension
    format:    file format
    encoding:  encoding of light as bytes; None for OpenEXR
    light:     (h, w, 3) float32, scene-linear, bottom row first
    facts:     manifest entries of the lightmap
    charts:    (h, w) bool, texels of charts, which mip levels need; None to write no mip levels
    """

    name: str
    format: FileFormat
    encoding: Encoding | None
    light: np.ndarray
    facts: dict
    charts: np.ndarray | None = None

    def write(self, path: Path) -> None:
        """Write the file to a path; raises OSError or RuntimeError."""
        if self.encoding is None:
            write_exr(path, self.light, self.format, self.facts["output"] not in RATIO_MAPS)
            return
        if self.format.name == "ktx2":
            levels = [self.light] if self.charts is None else chart_mips(self.light, self.charts)
            path.write_bytes(ktx2_texture([level[::-1] for level in levels]))
            return
        texels = encode_in_bands(self.encoding, self.light)
        if self.format.name == "hdr":
            path.write_bytes(radiance_bytes(texels))
        else:
            path.write_bytes(png_bytes(texels, srgb=isinstance(self.encoding, Srgb)))

    @property
    def entry(self) -> dict:
        """Manifest entry of the file."""
        facts = {"format": self.format.name, "encoding": _in_words(self), "intensity": 1.0}
        if self.encoding is not None:
            facts |= {
                "intensity": self.encoding.intensity,
                "decode_texel": self.encoding.formula,
                "range": self.encoding.largest,
                **_parameters(self.encoding),
            }
        return {**self.facts, **facts}


def lightmap_files(
    lightmaps: np.ndarray,
    destination: Destination,
    facts: Sequence[dict],
    has_patch: np.ndarray | None = None,
) -> Iterator[LightmapFile]:
    """Yield the files of lightmaps, (m, h, w, 3) float32, first those for Blender, then for engines.

    facts:      manifest entries of each lightmap, including its output
    has_patch:  (atlases, h, w) bool, texels of charts; the lightmaps are all atlases of the first output,
                then of the next one; None if unknown
    """
    brightest = _brightest(lightmaps, [fact["output"] for fact in facts])
    each = list(zip(lightmaps, destination.stems, destination.formats, facts, strict=True))
    for light, stem, chosen, fact in each:
        shown, output = chosen.shown, fact["output"]
        entry = fact if shown == chosen else {**fact, "shown_for": f"{stem}{chosen.endings[-1]}"}
        encoding = shown.encoding(output, brightest[output])
        yield LightmapFile(f"{stem}{shown.endings[0]}", shown, encoding, light, entry)
    for index, (light, stem, chosen, fact) in enumerate(each):
        if chosen.shown != chosen:
            encoding = chosen.encoding(fact["output"], brightest[fact["output"]])
            charts = None if has_patch is None else has_patch[index % len(has_patch)]
            yield LightmapFile(f"{stem}{chosen.endings[-1]}", chosen, encoding, light, fact, charts)


def _brightest(lightmaps: np.ndarray, outputs: Sequence[str]) -> dict[str, float]:
    """Return the maximum absolute value of all lightmaps of each output."""
    found: dict[str, float] = {}
    for light, output in zip(lightmaps, outputs, strict=True):
        found[output] = max(found.get(output, 0.0), float(np.abs(light).max()))
    return found


def _in_words(file: LightmapFile) -> str:
    """Describe the pixel format of a file in words, such as "PNG, 8-bit RGBM"."""
    format = file.format
    match format.name:
        case "exr":
            bits = 16 if format.stores_half else 32
            return f"OpenEXR, {bits}-bit float, scene-linear Rec.709"
        case "hdr":
            return "Radiance RGBE, scene-linear Rec.709"
        case "ktx2":
            return "KTX2, RGB9E5, scene-linear Rec.709"
        case "png":
            biased = isinstance(file.encoding, SignedNorm)
            return f"PNG, {format.png_depth}-bit {'biased, no colour space' if biased else 'sRGB'}"
    return f"PNG, 8-bit {format.name.upper() if format.name != 'logluv' else 'LogLuv'}, no colour space"


def _parameters(encoding: Encoding) -> dict[str, float]:
    """Return the parameters of an encoding, by name."""
    return {name: getattr(encoding, name) for name in ("exposure", "gamma") if hasattr(encoding, name)}
