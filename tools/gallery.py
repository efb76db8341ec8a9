"""Builds, bakes and exports the gallery's scenes, and shows them in Blender and engines.

python -m tools.gallery docs/gallery [--scenes interior level street] [--page docs/gallery.md]
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from types import ModuleType

from tools.engines import bevy, cornell, godot
from tools.engines.cornell import ROOT, render_preview
from tools.engines.web import BABYLON, PLAYCANVAS, THREE, WebEngine
from tools.headless import blender
from tools.page_table import replace_rows, table_row

#: Size of a picture, pixels.
_SIZE = (960, 600)

#: Samples of a pixel of Blender's picture, bounces through glass, and quality of JPEG files, %.
_SAMPLES, _GLASS_BOUNCES, _JPEG = 16, 8, 88

#: Places of the tables in a page, and their titles.
_MARKS = ("<!-- gallery: begin -->", "<!-- gallery: end -->")
_TITLES = ("Scene", "objects", "triangles", "texels", "bake", "files", "machine")
_PIXEL_MARKS = ("<!-- pixels: begin -->", "<!-- pixels: end -->")
_PIXEL_TITLES = ("Picture", "median of pixels", "90 % of pixels below")

#: Manifest of light probes beside an exported file.
_PROBES = "probes.json"


@dataclass(frozen=True)
class Entry:
    """Settings of a scene of the gallery.

    title       as the page calls it
    resolution  width of its lightmap, texels
    exposure    of the pictures, stops
    state       light state of the pictures; empty for all light groups as they were baked
    groups      True to bake a map for each light group
    moved       name of a dynamic object that light probes light; empty for none
    places      its places in further pictures by the endings of their names, m
    """

    title: str
    resolution: int
    exposure: float
    state: str = ""
    groups: bool = False
    moved: str = ""
    places: dict[str, tuple[float, float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Engine:
    """An engine of the gallery.

    title   name of the engine
    export  its choice in the export dialog
    render  renders a file in the places of its dynamic object, which the open scene tells; returns
            (n, h, w, 3) float32, linear, bottom row first; without light probes the first place alone
    module  says what is missing
    shown   True if the page shows its pictures
    """

    title: str
    export: str
    render: Callable[[Path, Entry], np.ndarray]
    module: ModuleType | WebEngine
    shown: bool = False


ENTRIES = {
    "interior": Entry("Living room", 1024, 2.4, moved="Robot", places={"shade": (0.85, -0.45, 0.0)}),
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
    parser.add_argument("--keep", action="store_true", help="show the bakes that are in --files already")
    parser.add_argument("--page", type=Path, help="page whose table gets the rows")
    options = parser.parse_args()
    modules = [_ENGINES[name].module for name in options.engines]
    if missing := [module.missing() for module in modules if module.missing()]:
        raise SystemExit("\n".join(missing))
    for module in modules:
        if module is not godot:
            module.install()
    options.out.mkdir(parents=True, exist_ok=True)
    with blender():
        for name in options.scenes:
            row, pixels = _show(name, options)
            print("\n".join([row, *pixels]))
            if options.page:
                replace_rows(options.page, _MARKS, _TITLES, [row])
                replace_rows(options.page, _PIXEL_MARKS, _PIXEL_TITLES, pixels)


def _show(name: str, options: argparse.Namespace) -> tuple[str, list[str]]:
    """Bake and export a scene, write its pictures; return its row, and rows that compare its pictures."""
    import bpy

    entry, folder = ENTRIES[name], (options.files / name).resolve()
    if options.keep:
        bpy.ops.wm.open_mainfile(filepath=str(folder / f"{name}.blend"))
        report = json.loads(bpy.context.scene.hemibake.report)
    else:
        report = bake(name, folder, options.quality)
    if entry.state:
        bpy.ops.hemibake.light_state_apply(name=entry.state)
    pictures = {"blender": render_pictures(folder, entry)}
    _write(options.out, name, "blender", pictures["blender"])
    size = 0
    for engine_name in options.engines:
        engine = _ENGINES[engine_name]
        path = export(name, folder / engine_name, engine.export)
        size = size or path.stat().st_size
        pictures[engine_name] = engine.render(path, entry)
        if engine.shown:
            _write(options.out, name, engine_name, pictures[engine_name])
    row = table_row(
        entry.title, f"{report['objects']:,}", f"{report['triangles']:,}", f"{report['patches']:,}",
        f"{report['seconds']['total']:,.0f} s", f"{size / 1e6:.0f} MB", ", ".join(report["devices"].values()),
    )  # fmt: skip
    return row, [_compared(entry, other, pictures) for other in options.engines]


def _write(folder: Path, name: str, engine: str, pictures: np.ndarray) -> None:
    """Write the pictures of an engine; the first one has no ending."""
    for ending, pixels in zip(("", *(f"_{end}" for end in ENTRIES[name].places)), pictures, strict=False):
        write_jpeg(folder / f"{name}{ending}_{engine}.jpg", pixels)


def _compared(entry: Entry, engine: str, pictures: dict[str, np.ndarray]) -> str:
    """Return a row on the differences between the first pictures of an engine and of Blender.

    Both are clipped at 1, as the Compatibility renderer of Godot does.
    """
    shown, wanted = (np.clip(pictures[name][0], 0, 1) for name in (engine, "blender"))
    off = cornell.differences(shown, wanted)
    median, high = (f"{100 * np.percentile(off, part):.1f} %" for part in (50, 90))
    return table_row(f"{entry.title}, {_ENGINES[engine].title}", median, high)


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
    settings.light_probes = bool(entry.moved)
    scene.view_settings.view_transform, scene.view_settings.exposure = "AgX", entry.exposure
    folder.mkdir(parents=True, exist_ok=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / f"{name}.blend"))
    bpy.ops.hemibake.bake()
    bpy.ops.wm.save_mainfile()
    return json.loads(settings.report)


def _module(name: str) -> ModuleType:
    """Return the module of examples/gallery_scenes that builds a scene."""
    if str(ROOT / "examples") not in sys.path:
        sys.path.insert(0, str(ROOT / "examples"))
    return import_module(f"gallery_scenes.{name}")


def render_pictures(folder: Path, entry: Entry) -> np.ndarray:
    """Return the preview as Cycles renders it, (n, h, w, 3) float32, linear, bottom row first.

    The dynamic object returns to its first place.
    """
    import bpy

    scene = bpy.context.scene
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", _SAMPLES
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.cycles.max_bounces = scene.cycles.transmission_bounces = _GLASS_BOUNCES
    scene.cycles.diffuse_bounces = scene.cycles.glossy_bounces = 0
    pictures = [render_preview(folder / "preview.exr", *_SIZE)]
    moved = bpy.data.objects.get(entry.moved)
    for place in entry.places.values():
        first, moved.location = moved.location.copy(), place
        pictures.append(render_preview(folder / "preview.exr", *_SIZE))
        moved.location = first
    return np.stack(pictures)


def export(name: str, folder: Path, engine: str) -> Path:
    """Write the baked scene for an engine, with its light probes; return the path of the .glb file."""
    import bpy

    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.glb"
    bpy.ops.hemibake.export_for_engine(filepath=str(path), engine=engine)
    baked = folder.parent / "lightmaps"
    for file in baked.glob("*_Probes.*"):
        shutil.copy2(file, folder)
        shutil.copy2(baked / "hemibake.json", folder / _PROBES)
    return path


def _render_three(path: Path, entry: Entry) -> np.ndarray:
    if not entry.moved:
        return _render_web(THREE)(path, entry)
    places = _places(entry)
    return _halved(
        THREE.show_path(path, *_large(), entry.moved, places, (), entry.state, _sky(), _PROBES).pixels
    )


def _render_web(engine: WebEngine) -> Callable[[Path, Entry], np.ndarray]:
    """Return a function that renders a file without its dynamic object."""

    def render(path: Path, entry: Entry) -> np.ndarray:
        hidden = (entry.moved,) if entry.moved else ()
        return _halved(
            engine.show(path, *_large(), hidden, state=entry.state, background=_sky()).pixels[None]
        )

    return render


def _render_godot(path: Path, entry: Entry) -> np.ndarray:
    scene = path.with_suffix(".tscn")
    if not entry.moved:
        return _halved(godot.render(scene, *_large(), state=entry.state, background=_sky())[None])
    return _halved(godot.render_path(scene, *_large(), entry.moved, _places(entry), background=_sky()))


def _render_bevy(path: Path, entry: Entry) -> np.ndarray:
    probes = _PROBES if entry.moved else ""
    shown = bevy.show(path, *_large(), state=entry.state, background=_sky(), probes=probes)
    return _halved(shown.pixels[None])


def _places(entry: Entry) -> list[tuple[float, float, float]]:
    """Return the places of the dynamic object, y up, m: the place in the scene, then the others."""
    import bpy

    places = [bpy.data.objects[entry.moved].location, *entry.places.values()]
    return [(x, z, -y) for x, y, z in places]


def _large() -> tuple[int, int]:
    """Return twice the size of a picture: engines show one sample of each pixel."""
    return 2 * _SIZE[0], 2 * _SIZE[1]


def _halved(pictures: np.ndarray) -> np.ndarray:
    """Return the means of 2 × 2 pixels of pictures, (n, h, w, 3)."""
    count, height, width = pictures.shape[:3]
    return pictures.reshape(count, height // 2, 2, width // 2, 2, -1).mean(axis=(2, 4))


_ENGINES = {
    "three": Engine("three.js", "THREE", _render_three, THREE, shown=True),
    "godot": Engine("Godot", "GODOT", _render_godot, godot, shown=True),
    "babylon": Engine("Babylon.js", "THREE", _render_web(BABYLON), BABYLON),
    "playcanvas": Engine("PlayCanvas", "THREE", _render_web(PLAYCANVAS), PLAYCANVAS),
    "bevy": Engine("Bevy", "BEVY", _render_bevy, bevy),
}


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
