"""Compares engines with Blender's preview on the exported Cornell box: tables and pictures of the docs.

python -m tools.engines.compare docs/engines [--engines three godot bevy babylon playcanvas unlit]
"""

from __future__ import annotations

import argparse
import tempfile
from functools import partial
from pathlib import Path

import numpy as np

from tools.engines import bevy, cornell, godot
from tools.engines.web import BABYLON, PLAYCANVAS, THREE, WebEngine
from tools.headless import blender, load

#: Width of each picture, pixels, factor on their difference, and pixels between two.
_WIDTH, _FACTOR, _GAP = 360, 20, 8

#: Kinds of exports: name, format of the lightmaps in the file, and whether three.js uses separate files.
_KINDS = (
    ("Radiance HDR in the file", "HDR", False),
    ("OpenEXR beside it", "HDR", True),
    ("8-bit PNG in the file", "PNG", False),
)


def main() -> None:
    """Print a table of differences and write a picture of each engine."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, help="folder for the pictures")
    parser.add_argument("--engines", nargs="+", choices=list(_ENGINES), default=list(_ENGINES))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    chosen = [_ENGINES[name] for name in options.engines]
    if missing := [module.missing() for module, _ in chosen if module.missing()]:
        raise SystemExit("\n".join(missing))
    with blender():
        for name, (_, compare) in zip(options.engines, chosen, strict=True):
            with tempfile.TemporaryDirectory() as folder:
                compare(Path(folder), options.out.resolve() / f"{name}.png")


def compare_three(folder: Path, picture: Path) -> None:
    """Print the differences of three.js, and write a picture."""
    THREE.install()
    cornell.bake()
    wanted = cornell.preview(_WIDTH, folder)
    pictures = [export(folder, kind, files) for _, kind, files in _KINDS]
    for (name, *_), shown in zip(_KINDS, pictures, strict=True):
        print(row(name, shown, wanted))
    give_gloss()
    print(row("with *IOR Level* 0.5", export(folder, "HDR", files=False), wanted))
    write_picture(picture, wanted, pictures[0])


def compare_godot(folder: Path, picture: Path) -> None:
    """Print the differences of Godot, and write a picture with spherical harmonics.

    The lamp is hidden in Godot, which shows emission with another brightness, and left out.
    """
    for name, directional in (
        ("Lightmap", None),
        ("*Spherical Harmonics*, with a normal map", "spherical_harmonics"),
    ):
        cornell.bake(directional=directional)
        wanted = cornell.preview(_WIDTH, folder)
        path = cornell.export(folder, engine="GODOT").with_suffix(".tscn")
        for bicubic in (False, True):
            shown = godot.render(path, _WIDTH, _WIDTH, (*cornell.HIDDEN, "Light"), bicubic)
            compared = np.where(wanted.max(axis=-1, keepdims=True) < 1, wanted, 0)
            print(row(f"{name}{', bicubic' if bicubic else ''}", np.where(compared > 0, shown, 0), compared))
            if not bicubic:
                write_picture(picture, wanted, shown)


def compare_bevy(folder: Path, picture: Path) -> None:
    """Print the differences of Bevy, and write a picture with directional maps."""
    bevy.install()
    for name, directional in (("Lightmap", None), ("*Directional*, with a normal map", "directional")):
        cornell.bake(directional=directional)
        wanted = cornell.preview(_WIDTH, folder)
        path = cornell.export(folder, "NONE")
        shown = bevy.show(path, _WIDTH, _WIDTH, cornell.HIDDEN).pixels
        print(row(name, shown, wanted))
    write_picture(picture, wanted, shown)


def compare_web(engine: WebEngine, choice: str, folder: Path, picture: Path) -> None:
    """Print the differences of an engine of the web, and write a picture.

    choice:  engine of the export
    """
    engine.install()
    cornell.bake()
    wanted = np.minimum(cornell.preview(_WIDTH, folder), 1 if choice == "UNLIT" else np.inf)
    shown = engine.render(cornell.export(folder, engine=choice), _WIDTH, _WIDTH, cornell.HIDDEN)
    print(row(engine.package, shown, wanted))
    write_picture(picture, wanted, shown)


_ENGINES = {
    "three": (THREE, compare_three),
    "godot": (godot, compare_godot),
    "bevy": (bevy, compare_bevy),
    "babylon": (BABYLON, partial(compare_web, BABYLON, "THREE")),
    "playcanvas": (PLAYCANVAS, partial(compare_web, PLAYCANVAS, "THREE")),
    "unlit": (THREE, partial(compare_web, THREE, "UNLIT")),
}


def export(folder: Path, kind: str, files: bool) -> np.ndarray:
    """Export, then render with three.js; return the image."""
    return THREE.render(cornell.export(folder, kind), _WIDTH, _WIDTH, cornell.HIDDEN, files)


def give_gloss() -> None:
    """Give all materials the gloss of Blender's new materials; the box has none."""
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
    pictures = load("operators.result.pictures")
    gap = np.ones((_WIDTH, _GAP, 3), np.float32)
    difference = np.clip(_FACTOR * np.abs(shown - wanted), 0, 1)
    both = pictures.exposed(np.concatenate([wanted, shown]))
    pictures.write_png(np.concatenate([both[:_WIDTH], gap, both[_WIDTH:], gap, difference], axis=1), path)


if __name__ == "__main__":
    main()
