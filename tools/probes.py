"""Compares light probes with small white spheres that Cycles bakes, at 27 points of a scene.

    python tools/probes.py [--blend FILE] [--samples N] [--table docs/design/probes.md]

Prints the error of each band at the worst and the median point, relative to the mean of band 0. Ends with
status 1 if one exceeds 3 %. Without --blend the scene is the Cornell box of examples.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402

from tools.headless import blender as blender_with_hemibake  # noqa: E402
from tools.headless import load, quiet_stdout  # noqa: E402

#: Limit of the errors, and the fraction of the scene's box that the grid fills.
_LIMIT, _FILLED = 0.03, 0.8

_MARKS = ("<!-- table: made by tools/probes.py -->", "<!-- end of table -->")


def main() -> None:
    """Bake, compare, print, and write the table."""
    options = parse()
    with blender_with_hemibake(), quiet_stdout():
        open_scene(options.blend)
        errors = compare(options.samples)
    rows = [row(f"band {band}", errors[:, band]) for band in range(3)]
    print("\n".join(rows))
    if options.table:
        write_table(options.table, rows)
    if errors.max() > _LIMIT:
        raise SystemExit(f"An error of {errors.max():.1%} exceeds {_LIMIT:.0%}.")


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--blend", type=Path, help="the scene; the Cornell box without it")
    parser.add_argument("--samples", type=int, default=1024, help="of Cycles for each facet of a sphere")
    parser.add_argument("--table", type=Path, help="page whose table to replace")
    return parser.parse_args()


def open_scene(blend: Path | None) -> None:
    """Open a file, or build the Cornell box."""
    import bpy

    if blend is not None:
        bpy.ops.wm.open_mainfile(filepath=str(blend.resolve()))
        return
    sys.path.insert(0, str(ROOT / "examples"))
    import cornell_box

    cornell_box.build()


def compare(samples: int) -> np.ndarray:
    """Return the errors of the three bands at 27 points, (27, 3), relative to the mean of band 0."""
    import bpy

    from tools.verification.cycles import realised
    from tools.verification.probe_spheres import bake_probes
    from tools.verification.run import read_for_bake

    volumes, harmonics = load("engine.scene.probe_volume"), load("engine.probes.spherical_harmonics")
    engine = load("engine")
    settings = bpy.context.scene.hemibake
    settings.quality, settings.resolution = "high", 128
    read, settings = read_for_bake(bpy.context)
    box = np.concatenate([mesh.positions.reshape(-1, 3) for mesh in read.scene.meshes])
    low, high = box.min(axis=0), box.max(axis=0)
    matrix = np.diag([*(_FILLED * (high - low) / 2), 1.0])
    matrix[:3, 3] = (low + high) / 2
    volume = volumes.ProbeVolume("Volume", matrix, (3, 3, 3))
    scene = replace(read.scene, probe_volumes=(volume,))
    settings = replace(settings, light_probes=True, probe_samples=6000, light_samples=512)
    (grid,) = engine.finished(engine.bake(scene, settings)).probes
    with realised(bpy.context, read, settings.resolution) as reference:
        expected = bake_probes(reference, grid.positions + read.scene.origin, samples, 1)
    differences = np.abs(grid.coefficients - expected).mean(axis=2)
    mean = expected[:, 0].mean()
    return np.stack([differences[:, band == harmonics.BANDS].max(axis=1) / mean for band in range(3)], axis=1)


def row(name: str, errors: np.ndarray) -> str:
    """Return a row of the table: median and largest error."""
    return f"| {name} | {100 * np.median(errors):.2f} % | {100 * errors.max():.2f} % |"


def write_table(page: Path, rows: list[str]) -> None:
    """Replace the table between the marks of a page."""
    text = page.read_text(encoding="utf-8")
    before, rest = text.split(_MARKS[0])
    after = rest.split(_MARKS[1])[1]
    table = "\n".join(["", "| Coefficients | median | largest of 27 |", "|---|---|---|", *rows, ""])
    page.write_text(f"{before}{_MARKS[0]}\n{table}\n{_MARKS[1]}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
