"""Draws the pictures of docs/design/quality.md: leaks, contacts, invalid texels and small charts.

    python tools/texels.py [--only NAME ...] [--out docs/design/quality]
    python tools/texels.py --contacts [--only NAME ...]

With --contacts light beside lines of contact is compared with Cycles' at the same points.

Each picture has three views: the lightmap that shows the light at texels' centres, that of several points of
a texel, and what Cycles renders of the scene itself. Lightmaps are shown as Hemibake's preview shows them.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from tools.headless import blender, load, quiet_stdout  # noqa: E402
from tools.page_table import table_row  # noqa: E402

#: Distances from lines of contact, texels.
_DISTANCES = ((0.0, 0.25), (0.25, 1.0), (1.0, 2.0), (2.0, 3.0))

_TITLES = ("scene", "texel", *(f"{low:g} to {high:g} texels" for low, high in _DISTANCES))

#: Size of a view, pixels, and samples of a pixel: of a lightmap, and of the scene itself.
_SIZE, _SHOWN, _TRUE = (300, 220), 16, 256

#: Settings of the lightmap of texel centres, and of that of several points.
_CENTRES = {"texel_samples": "1", "hide_seams": False}
_SEVERAL = {"texel_samples": "16", "hide_seams": True}


def main() -> None:
    """Make the pictures, or the table."""
    options = parse()
    options.out.mkdir(parents=True, exist_ok=True)
    with blender():
        if options.contacts:
            _measure_contacts(options)
            return
        from tools.verification import texel_scenes

        texel_scenes.register_files(options.scenes)
        for name in options.only or texel_scenes.SCENES:
            views = [_view(texel_scenes.SCENES[name], changed) for changed in (_CENTRES, _SEVERAL, {})]
            path = options.out / f"texels_{name}.png"
            load("operators.result.pictures").write_png(np.concatenate(views, axis=1), path)
            print(path, flush=True)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", help="names of scenes; all without it")
    parser.add_argument("--contacts", action="store_true", help="measure lines of contact")
    parser.add_argument("--samples", type=int, default=128, help="of Cycles, for each point beside lines")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "design" / "quality", help="folder")
    parser.add_argument(
        "--scenes", type=Path, default=ROOT.parent / "shared" / "scenes", help="folder of files"
    )
    options = parser.parse_args()
    options.out = options.out.resolve()
    return options


def _measure_contacts(options: argparse.Namespace) -> None:
    """Print a line of the table for each scene of contacts."""
    from tools.verification.contact_scenes import SCENES

    print(table_row(*_TITLES))
    for name in options.only or SCENES:
        print(_contact_row(SCENES[name], options.samples), flush=True)


def _contact_row(build, samples: int) -> str:
    """Return a line of the table: mean and RMS difference, of texel centres and of several points."""
    import bpy

    from tools.verification.contact_lines import beside_contacts

    with quiet_stdout():
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        contacts = build()
        settings = bpy.context.scene.hemibake
        settings.quality, settings.resolution = "preview", contacts.resolution
        settings.texel_samples = _SEVERAL["texel_samples"]
        beside = beside_contacts(bpy.context, contacts, samples)
    cells = []
    for distance in _DISTANCES:
        centres, several = (beside.off(number, *distance) for number in (0, 1))
        cells.append(f"{centres[0]:+.1%}, {centres[1]:.1%} → {several[0]:+.1%}, {several[1]:.1%}")
    return table_row(build.__doc__.rstrip("."), f"{100 * beside.texel:.1f} cm", *cells)


def _view(build, changed: dict) -> np.ndarray:
    """Return a view of a scene, (h, w, 3), by a lightmap of changed settings; by Cycles without any."""
    import bpy

    from tools.verification.renders import render

    with quiet_stdout(), tempfile.TemporaryDirectory() as folder:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        view = build()
        if changed:
            _show_lightmap(changed, view.resolution, folder)
        for name in view.removed:
            bpy.data.objects[name].hide_render = bool(changed)
        return render(_SIZE, _SHOWN if changed else _TRUE, view.exposure)


def _show_lightmap(changed: dict, resolution: int, folder: str) -> None:
    """Bake, and let surfaces show their lightmaps."""
    import bpy

    settings = bpy.context.scene.hemibake
    settings.quality, settings.resolution, settings.directory = "preview", resolution, folder
    for name, value in changed.items():
        setattr(settings, name, value)
    bpy.ops.hemibake.bake()
    bpy.ops.hemibake.preview()


if __name__ == "__main__":
    main()
