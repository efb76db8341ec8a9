"""Measures steps of light across seams with and without Hide Seams, and draws them beside Cycles.

    python tools/seams.py [--only NAME ...] [--out out/seams] [--page docs/design/quality.md]

With --page the table between the two marks of that file is replaced, and its pictures are written beside it.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from tools.headless import MODULE, blender, load, quiet_stdout  # noqa: E402
from tools.page_table import replace_table, table_row  # noqa: E402

_MARKS = ("<!-- seams: made by tools/seams.py -->", "<!-- end of seams -->")

_TITLES = (
    "scene", "borders (m)", "mean", "median", "p90", "max", "mean falls", "changed elsewhere", "s",
)  # fmt: skip

#: Size of a picture, albedo of its surfaces, and exposure.
_SIZE, _ALBEDO, _EXPOSURE = (300, 250), 0.6, -0.3


def main() -> None:
    """Bake every scene with and without Hide Seams."""
    options = parse()
    with blender():
        import bpy

        from tools.verification.seam_scenes import SCENES

        options.out.mkdir(parents=True, exist_ok=True)
        lines = []
        for name in options.only or SCENES:
            with quiet_stdout():
                bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
                SCENES[name]()
            bpy.context.scene.hemibake.resolution = options.resolution
            lines.append(_line(name, SCENES[name].__doc__, options))
            print(lines[-1], flush=True)
    if options.page:
        replace_table(options.page, _MARKS, _TITLES, lines)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", help="names of scenes")
    parser.add_argument("--resolution", type=int, default=128, help="of the lightmaps, texels")
    parser.add_argument("--samples", type=int, default=256, help="of Cycles, per pixel")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "seams", help="folder of the pictures")
    parser.add_argument("--page", type=Path, help="page whose table is replaced")
    options = parser.parse_args()
    options.out = options.out.resolve()
    return options


def _line(name: str, title: str, options: argparse.Namespace) -> str:
    """Bake a scene and write its picture; return its line of the table."""
    import bpy

    from tools.verification.renders import aim, render, show_lightmaps
    from tools.verification.run import read_for_bake
    from tools.verification.steps import find_border

    with quiet_stdout():
        read, settings = read_for_bake(bpy.context)
        settings = replace(settings, visibility="rays", intermediates=False)
        plain, fitted = (_baked(read.scene, replace(settings, hide_seams=on)) for on in (False, True))
        border = find_border(read.scene)
        aim((-0.9, -3.4, 2.8), (0, 0, 0.9))
        pictures = [render(_SIZE, options.samples, _EXPOSURE)]
        for lightmap in (fitted, plain):
            show_lightmaps(lightmap.atlases, lightmap.display, _ALBEDO)
            pictures.insert(0, render(_SIZE, 16, _EXPOSURE))
        load("operators.result.pictures").write_png(
            np.concatenate(pictures, axis=1), options.out / f"seams_{name}.png"
        )
    steps = [border.steps(lightmap.display) for lightmap in (plain, fitted)]
    changed = _changed(plain, fitted, border)
    added = fitted.report.seconds["outputs"] - plain.report.seconds["outputs"]
    return _row(title.rstrip("."), border.length.sum(), *map(_figures, steps), changed, added)


def _baked(scene, settings):
    """Return the lightmap of an engine's scene."""
    engine = importlib.import_module(f"{MODULE}.engine")
    return engine.finished(engine.bake(scene, settings))


def _figures(steps: np.ndarray) -> tuple[float, ...]:
    """Return mean, median, p90 and maximum of steps."""
    return float(steps.mean()), *np.quantile(steps, [0.5, 0.9, 1])


def _changed(plain, fitted, border) -> float:
    """Return the part of texels that no seam reads and that differ by more than 0.5 % of their light."""
    beside = border.read(plain.has_patch.shape[1], len(plain.has_patch))
    seen = plain.has_patch & plain.known & ~beside
    off = np.abs(fitted.display - plain.display).max(axis=3) > 0.005 * plain.display.max(axis=3)
    return float(off[seen].mean())


def _row(title, length, before, after, changed, added) -> str:
    figures = [f"{one:.2%} → {other:.3%}" for one, other in zip(before, after, strict=True)]
    return table_row(
        title, f"{length:.1f}", *figures, f"{before[0] / after[0]:.0f}×", f"{changed:.2%}", f"{added:.2f}"
    )


if __name__ == "__main__":
    main()
