"""Compares light probes with small white spheres that Cycles bakes, at 27 points of each scene.

    python tools/probes.py [--scenes FOLDER] [--only NAME ...] [--samples N] [--page docs/design/probes.md]

Prints a row for each scene: the largest error of each band, relative to the mean of band 0, and the noise
of Cycles. Ends with status 1 if an error exceeds 3 %. Without --scenes, the scene is the Cornell box.
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
from tools.page_table import replace_rows, table_row  # noqa: E402

#: Limit of the errors, and the fraction of the scene's box that the grid fills.
_LIMIT, _FILLED = 0.03, 0.8

#: Number of points, and of probes along each axis, of which some may lie inside geometry.
_POINTS, _PROBES = 27, 4

#: Scenes with the resolutions of their lightmaps, texels, and the quality. A point of house is 2 mm from a
#: surface, so texels must be narrower.
_SCENES = {"Cornell box": (128, "high"), "living_room": (256, "high"), "house": (1024, "preview")}

_TITLES = ("Scene", "Points", "Band 0", "Band 1", "Band 2", "Noise of Cycles")

_MARKS = ("<!-- table: made by tools/probes.py -->", "<!-- end of table -->")


def main() -> None:
    """Bake, compare, print, and write the rows."""
    options = parse()
    worst = 0.0
    with blender_with_hemibake():
        for name in options.only or (_SCENES if options.scenes else ["Cornell box"]):
            with quiet_stdout():
                open_scene(name, options.scenes)
                errors, noise = compare(*_SCENES[name], options.samples)
            worst = max(worst, errors.max())
            figures = [f"{100 * error:.2f} %" for error in errors.max(axis=0)]
            row = table_row(
                name, str(len(errors)), *figures, " / ".join(f"{100 * x:.2f}" for x in noise) + " %"
            )
            print(row, flush=True)
            if options.page:
                replace_rows(options.page, _MARKS, _TITLES, [row])
    if worst > _LIMIT:
        raise SystemExit(f"An error of {worst:.1%} exceeds {_LIMIT:.0%}.")


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=Path, help="folder with scenes; the Cornell box alone without it")
    parser.add_argument("--only", nargs="+", choices=list(_SCENES), help="names of scenes")
    parser.add_argument("--samples", type=int, default=512, help="of Cycles for each facet of a sphere")
    parser.add_argument("--page", type=Path, help="page whose rows are replaced")
    return parser.parse_args()


def open_scene(name: str, folder: Path | None) -> None:
    """Open a scene of a folder without its doubled faces, or build the Cornell box."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    if name == "Cornell box":
        sys.path.insert(0, str(ROOT / "examples"))
        import cornell_box

        cornell_box.build()
        return
    from tools.verification import scenes
    from tools.verification.doubled_faces import remove_doubled_faces

    scenes.register_files(folder)
    scenes.SCENES[name]()
    remove_doubled_faces()


def compare(resolution: int, quality: str, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors of the bands, (n, 3), relative to the mean of band 0, and the noise of Cycles, (3,).

    The points are evenly chosen among the probes that are not inside geometry. Noise is the standard error of
    a coefficient.
    """
    import bpy

    from tools.verification.cycles import realised
    from tools.verification.probe_spheres import bake_probes
    from tools.verification.run import read_for_bake

    engine, bands = load("engine"), load("engine.probes.spherical_harmonics").BANDS
    settings = bpy.context.scene.hemibake
    settings.quality, settings.resolution = quality, resolution
    read, settings = read_for_bake(bpy.context)
    scene = replace(read.scene, probe_volumes=(volume_around(read.scene),))
    settings = replace(settings, light_probes=True, probe_samples=6000, light_samples=512)
    (grid,) = engine.finished(engine.bake(scene, settings)).probes
    valid = np.flatnonzero(grid.validity > 0)
    valid = valid[np.unique(np.linspace(0, len(valid) - 1, _POINTS).astype(int))]
    points = grid.positions[valid] + read.scene.origin
    with realised(bpy.context, read, resolution) as reference:
        bakes = [bake_probes(reference, points, samples // 2, seed) for seed in (1, 2)]
    expected = np.mean(bakes, axis=0)
    mean = expected[:, 0].mean()
    errors = np.abs(grid.coefficients[valid] - expected).mean(axis=2) / mean
    noise = np.square((bakes[0] - bakes[1]) / 2 / mean)
    of_bands = [band == bands for band in range(3)]
    largest = np.stack([errors[:, band].max(axis=1) for band in of_bands], axis=1)
    return largest, np.sqrt([noise[:, band].mean() for band in of_bands])


def volume_around(scene):
    """Return a volume of probes around a scene."""
    box = np.concatenate([mesh.positions.reshape(-1, 3) for mesh in scene.meshes])
    low, high = box.min(axis=0), box.max(axis=0)
    matrix = np.diag([*(_FILLED * (high - low) / 2), 1.0])
    matrix[:3, 3] = (low + high) / 2
    return load("engine.scene.probe_volume").ProbeVolume("Volume", matrix, (_PROBES,) * 3)


if __name__ == "__main__":
    main()
