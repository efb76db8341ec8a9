"""Measures the error of lightmaps with and without Denoise in four scenes, and draws a picture.

    python tools/denoise.py --scenes FOLDER [--only NAME ...] [--page docs/design/quality.md]
    python tools/denoise.py --picture docs/design/quality/denoise.png

Lightmaps have the settings of the preset Draft, but for the numbers of rays that the table names: of a
patch, and to each light. The truth is the mean of bakes with 1,024 rays a patch and 256 to each light.
An error is the RMSE of texels that are not filled, relative to their mean, without → with Denoise;
beside it is the processor time of the bake with it. FOLDER holds house.glb, with an HDRI, and
living_room.blend. With --page the rows of the scenes that were measured are replaced in the table
between the two marks of that file.

The picture shows the Cornell box by a lightmap of Draft without and with Denoise, and by Cycles.
"""

from __future__ import annotations

import argparse
import importlib
import runpy
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "examples")]

from tools.headless import MODULE, blender, load, quiet_stdout  # noqa: E402
from tools.page_table import replace_rows, table_row  # noqa: E402

_MARKS = ("<!-- denoise: made by tools/denoise.py -->", "<!-- end of denoise -->")

#: Rays of a patch, and those to each light.
_RAYS = ((64, 16), (64, 32), (64, 64), (16, 16))

_TITLES = ("scene", "texels", *(f"{rays} + {light_rays} rays" for rays, light_rays in _RAYS), "measured")

#: Settings of the bakes whose mean is the truth.
_TRUTH = {"samples": 1024, "light_samples": 256, "tolerance": 1e-3}

#: A tool's scenes or a folder's, with the width of their lightmaps, texels.
_SCENES = {
    "cornell": ("cornell", 192), "sphere": ("sphere", 192), "living_room": ("living_room", 192),
    "house": ("house", 192), "house, 512 x 512": ("house", 512),
}  # fmt: skip

#: Size of a view of the picture, pixels, samples of a pixel of a lightmap and of Cycles', and exposure.
_SIZE, _SHOWN, _TRUE, _EXPOSURE = (300, 300), 16, 512, 0.6


def main() -> None:
    """Bake every scene with and without Denoise, or make the picture."""
    options = parse()
    with blender():
        if options.picture:
            _write_picture(options.picture)
            return
        rows = []
        for name in options.only or _SCENES:
            rows.append(_row(name, options))
            print(rows[-1], flush=True)
            if options.page:
                replace_rows(options.page, _MARKS, _TITLES, rows)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=Path, help="folder with scenes")
    parser.add_argument("--only", nargs="+", choices=list(_SCENES), help="names of scenes")
    parser.add_argument("--bakes", type=int, default=4, help="whose mean is the truth")
    parser.add_argument("--page", type=Path, help="page whose rows are replaced")
    parser.add_argument("--picture", type=Path, help="file of the picture")
    options = parser.parse_args()
    if not options.picture and not options.scenes:
        parser.error("--scenes names the folder with scenes.")
    return options


def _build(name: str, folder: Path) -> None:
    """Build or open a scene in an empty file, with the settings of Draft."""
    import bpy

    from tools.verification import scenes, seam_scenes

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scenes.register_files(folder)
    if name == "cornell":
        importlib.import_module("cornell_box").build()
    else:
        (scenes.SCENES | seam_scenes.SCENES)[name]()
    runpy.run_path(str(ROOT / "presets" / "bake" / "draft.py"))


def _row(title: str, options: argparse.Namespace) -> str:
    """Bake a scene; return its row of the table."""
    import bpy

    from tools.verification.run import read_for_bake

    name, resolution = _SCENES[title]
    with quiet_stdout():
        _build(name, options.scenes)
        bpy.context.scene.hemibake.resolution = resolution
        read, settings = read_for_bake(bpy.context)
    settings = replace(settings, visibility="rays", intermediates=False, denoise=False)
    truth = _truth(read.scene, settings, options.bakes)
    cells = []
    for rays, light_rays in _RAYS:
        noisy = replace(settings, samples=rays, light_samples=light_rays, seed=4711)
        (plain, _), (quiet, seconds) = (
            _baked(read.scene, replace(noisy, denoise=on)) for on in (False, True)
        )
        cells.append(f"{_error(plain, truth):.2%} → {_error(quiet, truth):.2%}, {seconds:.1f} s")
    return table_row(title, f"{plain.known.sum():,}", *cells, time.strftime("%Y-%m-%d"))


def _truth(scene, settings, count: int) -> np.ndarray:
    """Return the light without noise, as lightmaps show it: the mean of `count` bakes."""
    bakes = (_baked(scene, replace(settings, seed=seed, **_TRUTH))[0] for seed in range(count))
    return sum(lightmap.display.astype(np.float64) for lightmap in bakes) / count


def _baked(scene, settings):
    """Return the lightmap of an engine's scene, and the processor time that it took, s."""
    engine = importlib.import_module(f"{MODULE}.engine")
    began = time.process_time()
    lightmap = engine.finished(engine.bake(scene, settings))
    for warning in lightmap.report.warnings:
        print(warning, file=sys.stderr)
    return lightmap, time.process_time() - began


def _error(lightmap, truth: np.ndarray) -> float:
    """Return the RMSE of the texels that are not filled, relative to their mean."""
    exact = truth[lightmap.known]
    return float(np.sqrt(np.mean((lightmap.display[lightmap.known] - exact) ** 2)) / exact.mean())


def _write_picture(path: Path) -> None:
    """Write views of the Cornell box beside each other."""
    views = [_view(changed) for changed in ({"denoise": False}, {"denoise": True}, None)]
    load("operators.result.pictures").write_png(np.concatenate(views, axis=1), path.resolve())


def _view(changed: dict | None) -> np.ndarray:
    """Return a view of the Cornell box, (h, w, 3) sRGB, by a lightmap of changed settings; None by Cycles."""
    import bpy

    from tools.verification.renders import render

    with quiet_stdout(), tempfile.TemporaryDirectory() as folder:
        _build("cornell", ROOT)
        if changed is None:
            return render(_SIZE, _TRUE, _EXPOSURE)
        settings = bpy.context.scene.hemibake
        settings.resolution, settings.directory = _SCENES["cornell"][1], folder
        for setting, value in changed.items():
            setattr(settings, setting, value)
        bpy.ops.hemibake.bake()
        bpy.ops.hemibake.preview()
        return render(_SIZE, _SHOWN, _EXPOSURE)


if __name__ == "__main__":
    main()
