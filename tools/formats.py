"""Measures the error of each file format and writes the table of docs/reference/formats.md.

    python tools/formats.py            # a second, and Blender for the rows of OpenEXR

The light: 509 x 257 texels whose brightest channel grows from 0.001 to 16 along the columns, with all hues
along the rows, and grain of 2 % as a bake has. The error of a texel is the length of the difference of the
colours before and after, relative to the colour before.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

import numpy as np
from headless import MODULE, ROOT, blender

sys.path.insert(0, str(ROOT))
from engine.encoding.encoding import Encoding
from engine.encoding.ktx2 import SharedExponent, from_rgb9e5, ktx2_texture
from engine.encoding.logluv import LogLuv
from engine.encoding.png import png_bytes
from engine.encoding.radiance import radiance_bytes
from engine.encoding.rgbd import Rgbd
from engine.encoding.rgbe import Rgbe
from engine.encoding.rgbm import Rgbm
from engine.encoding.signed_norm import SignedNorm
from engine.encoding.srgb import Srgb

PAGE = ROOT / "docs" / "reference" / "formats.md"

#: What encloses the table in the page.
_BEGIN, _END = "<!-- table of tools/formats.py -->\n", "<!-- end of the table -->\n"

#: Brightest channel of the first and of the last column.
DARKEST, BRIGHTEST = 1e-3, 16.0

#: Formats that need no Blender: name in the table, encoding, and function that writes the file.
ENCODINGS: dict[str, tuple[Encoding, Callable[[np.ndarray], bytes]]] = {
    "Radiance HDR": (Rgbe(), radiance_bytes),
    "KTX2, Zstandard": (SharedExponent(), lambda texels: ktx2_texture([from_rgb9e5(texels[..., 0])])),
    "PNG, sRGB, Exposure −4": (Srgb(-4.0), lambda texels: png_bytes(texels, srgb=True)),
    "PNG, 16 bits, sRGB, Exposure −4": (Srgb(-4.0, 16), lambda texels: png_bytes(texels, srgb=True)),
    "PNG, 16 bits, biased, range 16": (SignedNorm(16.0), lambda texels: png_bytes(texels, srgb=False)),
    "RGBM, Range 16, Gamma 2.2": (Rgbm(16.0, 2.2), lambda texels: png_bytes(texels, srgb=False)),
    "RGBM, Range 16, Gamma 1": (Rgbm(16.0, 1.0), lambda texels: png_bytes(texels, srgb=False)),
    "RGBD, Range 16, Gamma 2.2": (Rgbd(16.0, 2.2), lambda texels: png_bytes(texels, srgb=False)),
    "RGBD, Range 16, Gamma 1": (Rgbd(16.0, 1.0), lambda texels: png_bytes(texels, srgb=False)),
    "LogLuv": (LogLuv(), lambda texels: png_bytes(texels, srgb=False)),
}

#: Depths and codecs of OpenEXR.
OPENEXR = {
    "OpenEXR, full floats, ZIP": (32, "zip"),
    "OpenEXR, half floats, ZIP": (16, "zip"),
    "OpenEXR, DWAA": (16, "dwaa"),
}


class Loss(NamedTuple):
    """Errors of light after it was written and read, relative to each texel, and the size of the file.

    mean, p99:  of all texels
    dark:       mean of those whose brightest channel is below 0.01, the darkest decade
    size:       bytes a texel
    """

    mean: float
    p99: float
    dark: float
    size: float


def light() -> np.ndarray:
    """Return light of all brightnesses and hues, (257, 509, 3) float32."""
    generator = np.random.default_rng(9)
    row, column = np.mgrid[0:1:257j, 0:1:509j]
    hue = 0.55 + 0.45 * np.cos(2 * np.pi * (row[..., None] + np.arange(3) / 3))
    grain = 1 + 0.02 * generator.standard_normal(hue.shape)
    colour = hue * grain
    colour /= colour.max(axis=-1, keepdims=True)
    return (colour * DARKEST * (BRIGHTEST / DARKEST) ** column[..., None]).astype(np.float32)


def loss(before: np.ndarray, after: np.ndarray, size: int) -> Loss:
    """Return the loss of light by encoding, for a file of `size` bytes."""
    difference = np.linalg.norm(after.astype(float) - before, axis=-1)
    error = difference / np.linalg.norm(before.astype(float), axis=-1)
    dark = before.max(axis=-1) < 10 * DARKEST
    figures = error.mean(), np.percentile(error, 99), error[dark].mean(), size / error.size
    return Loss(*map(float, figures))


def losses_of_encodings() -> dict[str, Loss]:
    """Return the losses of the formats that need no Blender."""
    before, found = light(), {}
    for name, (encoding, file) in ENCODINGS.items():
        texels = encoding.encode(before)
        found[name] = loss(before, encoding.decode(texels), len(file(texels)))
    return found


def losses_of_openexr(exr, file_format) -> Iterator[tuple[str, Loss]]:
    """Yield the losses of OpenEXR files, which Blender writes."""
    import bpy

    before = light()
    for name, (depth, codec) in OPENEXR.items():
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "light.exr"
            exr.write_exr(path, before, file_format.FileFormat("exr", depth, codec))
            image = bpy.data.images.load(str(path), check_existing=False)
            after = np.empty(len(image.pixels), np.float32)
            image.pixels.foreach_get(after)
            bpy.data.images.remove(image)
            yield name, loss(before, after.reshape(*before.shape[:2], -1)[..., :3], path.stat().st_size)


def table(losses: dict[str, Loss]) -> str:
    """Return the rows of the page's table."""
    head = "| Format | mean | 99th percentile | darkest decade | bytes a texel |\n|---|---|---|---|---|\n"
    return head + "".join(
        f"| {name} | {_percent(row.mean)} | {_percent(row.p99)} | {_percent(row.dark)} | {row.size:.1f} |\n"
        for name, row in losses.items()
    )


def told() -> dict[str, list[float]]:
    """Return the errors in the documentation's table, by format."""
    text = PAGE.read_text(encoding="utf-8").partition(_BEGIN)[2].partition(_END)[0]
    rows = [[cell.strip() for cell in line.strip("|\n ").split("|")] for line in text.splitlines()[2:]]
    return {row[0]: [float(cell.split()[0]) / 100 for cell in row[1:4]] for row in rows}


def _percent(error: float) -> str:
    return f"{np.format_float_positional(100 * error, 2, fractional=False, trim='-')} %"


def main() -> None:
    """Write the table into the page."""
    with blender():
        exr = import_module(f"{MODULE}.operators.result.exr")
        file_format = import_module(f"{MODULE}.operators.file_format")
        losses = dict(losses_of_openexr(exr, file_format))
    losses |= losses_of_encodings()
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(_BEGIN)
    PAGE.write_text(before + _BEGIN + table(losses) + _END + rest.partition(_END)[2], encoding="utf-8")


if __name__ == "__main__":
    main()
