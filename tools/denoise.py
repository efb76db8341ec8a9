"""Measures what Denoise does to the error of lightmaps, in four scenes, and writes a picture of one.

    python tools/denoise.py --scenes FOLDER [--only NAME ...] [--out out/denoise] [--page docs/quality.md]

The truth is the mean of bakes with 1,024 rays a patch and 256 to each light. An error is the RMSE of texels
that are not filled, relative to their mean. FOLDER holds house.glb, with an HDRI, and living_room.blend.
With --page the table between the two marks of that file is replaced, and the picture is written beside it.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "examples")]

from tools.headless import MODULE, blender, load, quiet_stdout  # noqa: E402
from tools.page_table import replace_table, table_row  # noqa: E402

_MARKS = ("<!-- denoise: made by tools/denoise.py -->", "<!-- end of denoise -->")

#: Rays of a patch, with those to each light, that are measured; the first is that of the table's times.
_RAYS = {64: 16, 32: 16, 16: 16}

_TITLES = ("scene", "texels", *(f"{rays} rays" for rays in _RAYS), "s for bounces", "s to denoise")

#: Settings of the bakes whose mean is the truth.
_TRUTH = {"samples": 1024, "light_samples": 256}

#: Names of the scenes: of a tool's or of a folder's.
_SCENES = ("cornell", "sphere", "house", "living_room")

#: Of which scene a picture is made, the part of the width that it shows, and the pixels of a texel.
_PICTURE, _PART, _ENLARGED = "cornell", 0.5, 3


def main() -> None:
    """Bake every scene with and without Denoise."""
    options = parse()
    with blender():
        options.out.mkdir(parents=True, exist_ok=True)
        lines = []
        for name in options.only or _SCENES:
            lines.append(_line(name, options))
            print(lines[-1], flush=True)
    if options.page:
        replace_table(options.page, _MARKS, _TITLES, lines)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=Path, required=True, help="folder with scenes")
    parser.add_argument("--only", nargs="+", choices=_SCENES, help="names of scenes")
    parser.add_argument("--resolution", type=int, default=256, help="of the lightmaps, texels")
    parser.add_argument("--bakes", type=int, default=8, help="whose mean is the truth")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "denoise", help="folder of the picture")
    parser.add_argument("--page", type=Path, help="page whose table is replaced")
    options = parser.parse_args()
    options.out = options.out.resolve()
    return options


def _build(name: str, folder: Path) -> None:
    """Build or open a scene in an empty file."""
    import bpy

    from tools.verification import scenes, seam_scenes

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scenes.register_files(folder)
    if name == "cornell":
        importlib.import_module("cornell_box").build()
    else:
        (scenes.SCENES | seam_scenes.SCENES)[name]()


def _line(name: str, options: argparse.Namespace) -> str:
    """Bake a scene; return its line of the table."""
    import bpy

    from tools.verification.run import read_for_bake

    with quiet_stdout():
        _build(name, options.scenes)
        bpy.context.scene.hemibake.resolution = options.resolution
        read, settings = read_for_bake(bpy.context)
    settings = replace(settings, visibility="rays", intermediates=False)
    truth = _truth(read.scene, settings, options.bakes)
    figures, pairs = [], []
    for rays, light_rays in _RAYS.items():
        noisy = replace(settings, samples=rays, light_samples=light_rays, seed=4711)
        pairs.append([_baked(read.scene, replace(noisy, denoise=on)) for on in (False, True)])
        figures.append(" → ".join(f"{_error(lightmap, truth):.2%}" for lightmap in pairs[-1]))
    plain, quiet = pairs[0]
    if name == _PICTURE:
        _write_picture([plain.display, quiet.display, truth], options.out / f"denoise_{name}.png")
    times = plain.report.seconds["hemicubes"], quiet.report.seconds["denoising"]
    return table_row(name, f"{plain.known.sum():,}", *figures, *(f"{seconds:.2f}" for seconds in times))


def _truth(scene, settings, count: int) -> np.ndarray:
    """Return the light without noise, as lightmaps show it: the mean of `count` bakes."""
    bakes = (_baked(scene, replace(settings, seed=seed, **_TRUTH)) for seed in range(count))
    return sum(lightmap.display.astype(np.float64) for lightmap in bakes) / count


def _baked(scene, settings):
    """Return the lightmap of an engine's scene, from the worker as in a window."""
    owner = importlib.import_module(f"{MODULE}.operators.worker_owner").owner
    progress = importlib.import_module(f"{MODULE}.engine.progress")
    return progress.finished(owner.bake_in_worker()(scene, settings))


def _error(lightmap, truth: np.ndarray) -> float:
    """Return the RMSE of the texels that are not filled, relative to their mean."""
    exact = truth[lightmap.known]
    return float(np.sqrt(np.mean((lightmap.display[lightmap.known] - exact) ** 2)) / exact.mean())


def _write_picture(lightmaps: list[np.ndarray], path: Path) -> None:
    """Write a corner of some lightmaps beside each other, equally exposed."""
    width = int(_PART * lightmaps[0].shape[1])
    corners = [lightmap[0, :width, :width] for lightmap in lightmaps]
    pixels = np.concatenate(corners, axis=1).repeat(_ENLARGED, axis=0).repeat(_ENLARGED, axis=1)
    pictures = load("operators.command_line.pictures")
    with quiet_stdout():
        pictures.write_png(pictures.exposed(pixels), path)


if __name__ == "__main__":
    main()
