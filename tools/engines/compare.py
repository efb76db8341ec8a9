"""Show the exported Cornell box with three.js beside Blender's preview: figures, and the picture of the docs.

python -m tools.engines.compare docs/engines
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

from tools.engines import cornell, three
from tools.headless import blender, load

#: Width of each picture, pixels, factor on their difference, and pixels between two.
_WIDTH, _FACTOR, _GAP = 360, 20, 8

#: Lightmaps in the file, or beside it: what they are called, the option, and whether files are used.
_KINDS = (
    ("Radiance HDR in the file", "HDR", False),
    ("OpenEXR beside it", "HDR", True),
    ("8-bit PNG in the file", "PNG", False),
)


def main() -> None:
    """Print a table of differences and write three.png."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, help="folder for the picture")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    if three.missing():
        raise SystemExit(three.missing())
    three.install()
    with tempfile.TemporaryDirectory() as folder, blender():
        cornell.bake()
        wanted = cornell.preview(_WIDTH, Path(folder))
        pictures = [export(Path(folder), kind, files) for _, kind, files in _KINDS]
        for (name, *_), picture in zip(_KINDS, pictures, strict=True):
            print(row(name, picture, wanted))
        give_gloss()
        print(row("with *IOR Level* 0.5", export(Path(folder), "HDR", files=False), wanted))
        write_picture(options.out.resolve() / "three.png", wanted, pictures[0])


def export(folder: Path, kind: str, files: bool) -> np.ndarray:
    """Return what three.js shows of an export."""
    import bpy

    path = folder / "cornell.glb"
    bpy.ops.hemibake.export_for_engine(filepath=str(path), lightmaps=kind)
    return three.render(path, _WIDTH, _WIDTH, cornell.HIDDEN, files)


def give_gloss() -> None:
    """Give all materials the gloss that Blender's own new ones have; the box has none."""
    import bpy

    for material in bpy.data.materials:
        material.node_tree.nodes["Principled BSDF"].inputs["Specular IOR Level"].default_value = 0.5


def row(name: str, picture: np.ndarray, wanted: np.ndarray) -> str:
    """Return a line of the table."""
    off = cornell.differences(picture, wanted)
    bias = picture.mean(dtype=np.float64) / wanted.mean(dtype=np.float64) - 1
    figures = (f"{part:.2%}" for part in (np.median(off), np.percentile(off, 99), (off > 0.02).mean()))
    return f"| {name} | {bias:+.2%} | {' | '.join(figures)} |".replace("%", " %")


def write_picture(path: Path, wanted: np.ndarray, shown: np.ndarray) -> None:
    """Write preview, render and their difference side by side, as sRGB."""
    pictures = load("operators.command_line.pictures")
    gap = np.ones((_WIDTH, _GAP, 3), np.float32)
    difference = np.clip(_FACTOR * np.abs(shown - wanted), 0, 1)
    both = pictures.exposed(np.concatenate([wanted, shown]))
    pictures.write_png(np.concatenate([both[:_WIDTH], gap, both[_WIDTH:], gap, difference], axis=1), path)


if __name__ == "__main__":
    main()
