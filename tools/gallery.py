"""Builds, bakes and exports the gallery's scenes, and shows them in Blender, three.js and Godot.

python -m tools.gallery docs/gallery [--scenes interior level street] [--page docs/gallery.md]
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from types import ModuleType

from tools.engines import godot
from tools.engines.cornell import ROOT, render_preview
from tools.engines.web import THREE
from tools.headless import blender
from tools.page_table import replace_rows, table_row

#: Size of a picture, pixels.
_SIZE = (960, 600)

#: Samples of a pixel of Blender's picture, bounces through glass, and quality of JPEG files, %.
_SAMPLES, _GLASS_BOUNCES, _JPEG = 16, 8, 88

#: Place of the table in a page, and its titles.
_MARKS = ("<!-- gallery: begin -->", "<!-- gallery: end -->")
_TITLES = ("Scene", "objects", "triangles", "texels", "bake", "files", "machine")


@dataclass(frozen=True)
class Entry:
    """Settings of a scene of the gallery.

    title       as the page calls it
    resolution  width of its lightmap, texels
    exposure    of the pictures, stops
    state       light state of the pictures; empty for all light groups as they were baked
    groups      True to bake a map for each light group
    """

    title: str
    resolution: int
    exposure: float
    state: str = ""
    groups: bool = False


ENTRIES = {
    "interior": Entry("Living room", 1024, 2.4),
    "level": Entry("Temple courtyard", 1024, 1.0),
    "street": Entry("Street at night", 1024, 1.2, "Evening", groups=True),
}


def main() -> None:
    """Write the pictures of each scene and its row of the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, help="folder for the pictures")
    parser.add_argument("--scenes", nargs="+", choices=list(ENTRIES), default=list(ENTRIES))
    parser.add_argument("--engines", nargs="*", choices=list(_ENGINES), default=list(_ENGINES))
    parser.add_argument(
        "--files", type=Path, default=Path("out/gallery"), help="folder for bakes and exports"
    )
    parser.add_argument("--quality", default="preview", help="of the bakes")
    parser.add_argument("--page", type=Path, help="page whose table gets the rows")
    options = parser.parse_args()
    known = {"three": THREE, "godot": godot}
    if missing := [known[name].missing() for name in options.engines if known[name].missing()]:
        raise SystemExit("\n".join(missing))
    options.out.mkdir(parents=True, exist_ok=True)
    with blender():
        rows = [_show(name, options) for name in options.scenes]
    print("\n".join(rows))
    if options.page:
        replace_rows(options.page, _MARKS, _TITLES, rows)


def _show(name: str, options: argparse.Namespace) -> str:
    """Bake and export a scene, write its pictures; return its row."""
    import bpy

    entry, folder = ENTRIES[name], (options.files / name).resolve()
    report = bake(name, folder, options.quality)
    if entry.state:
        bpy.ops.hemibake.light_state_apply(name=entry.state)
    pictures = {"blender": render_picture(folder)}
    size = 0
    for engine in options.engines:
        path = export(name, folder / engine, engine)
        size = size or path.stat().st_size
        pictures[engine] = _ENGINES[engine](path, entry.state)
    for engine, pixels in pictures.items():
        write_jpeg(options.out / f"{name}_{engine}.jpg", pixels)
    return table_row(
        entry.title, f"{report['objects']:,}", f"{report['triangles']:,}", f"{report['patches']:,}",
        f"{report['seconds']['total']:.0f} s", f"{size / 1e6:.0f} MB", ", ".join(report["devices"].values()),
    )  # fmt: skip


def bake(name: str, folder: Path, quality: str) -> dict:
    """Build a scene in an empty file and bake it; return the report.

    folder:  gets the lightmaps and the scene as a .blend file
    """
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    _module(name).build()
    entry, scene = ENTRIES[name], bpy.context.scene
    settings = scene.hemibake
    settings.quality, settings.resolution, settings.denoise = quality, entry.resolution, True
    settings.directory = str(folder / "lightmaps")
    if entry.groups:
        settings.outputs |= {"light_groups"}
    scene.view_settings.view_transform, scene.view_settings.exposure = "AgX", entry.exposure
    bpy.ops.hemibake.bake()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / f"{name}.blend"))
    return json.loads(settings.report)


def _module(name: str) -> ModuleType:
    """Return the module of examples/gallery_scenes that builds a scene."""
    if str(ROOT / "examples") not in sys.path:
        sys.path.insert(0, str(ROOT / "examples"))
    return import_module(f"gallery_scenes.{name}")


def render_picture(folder: Path) -> np.ndarray:
    """Return the preview as Cycles renders it, (h, w, 3) float32, linear, bottom row first."""
    import bpy

    scene = bpy.context.scene
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", _SAMPLES
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.cycles.max_bounces = scene.cycles.transmission_bounces = _GLASS_BOUNCES
    scene.cycles.diffuse_bounces = scene.cycles.glossy_bounces = 0
    return render_preview(folder / "preview.exr", *_SIZE)


def export(name: str, folder: Path, engine: str) -> Path:
    """Write the baked scene for an engine; return the path of the .glb file."""
    import bpy

    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.glb"
    bpy.ops.hemibake.export_for_engine(filepath=str(path), engine=engine.upper(), lightmaps="HDR")
    return path


def _render_three(path: Path, state: str) -> np.ndarray:
    THREE.install()
    return _halved(THREE.show(path, *_large(), state=state, background=_sky()).pixels)


def _render_godot(path: Path, state: str) -> np.ndarray:
    return _halved(godot.render(path.with_suffix(".tscn"), *_large(), state=state, background=_sky()))


def _large() -> tuple[int, int]:
    """Return twice the size of a picture: engines show one sample of each pixel."""
    return 2 * _SIZE[0], 2 * _SIZE[1]


def _halved(pixels: np.ndarray) -> np.ndarray:
    """Return the means of 2 × 2 pixels."""
    height, width = pixels.shape[:2]
    return pixels.reshape(height // 2, 2, width // 2, 2, -1).mean(axis=(1, 3))


#: Functions that render an exported file by the names of engines.
_ENGINES = {"three": _render_three, "godot": _render_godot}


def _sky() -> list[float]:
    """Return the radiance of the scene's world, linear."""
    import bpy

    background = bpy.context.scene.world.node_tree.nodes["Background"].inputs
    return [part * background["Strength"].default_value for part in background["Color"].default_value[:3]]


def write_jpeg(path: Path, pixels: np.ndarray) -> None:
    """Write linear pixels, (h, w, 3), bottom row first, with the view transform of the scene."""
    import bpy

    height, width = pixels.shape[:2]
    image = bpy.data.images.new("picture", width, height, float_buffer=True, alpha=False)
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = pixels
    image.pixels.foreach_set(rgba.ravel())
    scene = bpy.context.scene
    scene.render.image_settings.file_format, scene.render.image_settings.quality = "JPEG", _JPEG
    image.save_render(str(path), scene=scene)
    bpy.data.images.remove(image)


if __name__ == "__main__":
    main()
