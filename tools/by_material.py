"""Compares the mean light of each material with Cycles, in rooms and small scenes.

    python tools/by_material.py NAME ... [--samples N] [--scenes FOLDER] [--page docs/design/accuracy.md]

Prints a row for each material: texels, the difference of the means, and the noise of Cycles' mean. NAME is
a scene of `make verify` or of tools/verification/design_scenes.py.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402

from tools.headless import blender, load, quiet_stdout  # noqa: E402
from tools.page_table import replace_rows, table_row  # noqa: E402
from tools.verify import build, set_up  # noqa: E402

_TITLES = ("Scene, material", "Texels", "Difference", "Noise")

_MARKS = ("<!-- table: made by tools/by_material.py -->", "<!-- end of by_material -->")


def main() -> None:
    """Bake the scenes and print their rows."""
    options = parse()
    with blender():
        import bpy

        from tools.verification import design_scenes, scenes

        design_scenes.register_rooms(options.scenes)
        print(table_row(*_TITLES))
        for name in options.names:
            resolution, samples = scenes.ROOMS.get(name, (64, 256))
            with quiet_stdout():
                build(scenes, name)
                set_up(bpy.context.scene.hemibake, resolution, None, scenes.SETTINGS.get(name, {}))
                found = compare(bpy.context, options.samples or samples)
            for material, (texels, ours, truth, noise) in found.items():
                figures = f"{ours:.3g} instead of 0", ""
                if truth:
                    figures = f"{ours / truth - 1:+.1%}", f"{noise / truth:.1%}"
                row = table_row(f"{name}, {material}", str(texels), *figures)
                print(row, flush=True)
                if options.page:
                    replace_rows(options.page, _MARKS, _TITLES, [row])


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="+", metavar="NAME", help="scenes of make verify")
    parser.add_argument("--samples", type=int, help="of Cycles per texel, in each of two bakes")
    parser.add_argument(
        "--scenes", type=Path, default=ROOT.parent / "shared" / "scenes", help="folder of rooms"
    )
    parser.add_argument("--page", type=Path, help="page whose rows are replaced")
    return parser.parse_args()


def compare(context, samples: int) -> dict[str, tuple[int, float, float, float]]:
    """Return texels, the means of Hemibake and Cycles, and the noise of Cycles' mean, by name of a material.

    Channels that reflect nothing are left out, since Cycles stores no light there.
    """
    from tools.verification.areas import subdivided
    from tools.verification.cycles import realised
    from tools.verification.difference import weight_of
    from tools.verification.run import known_texels, read_for_bake

    engine = load("engine")
    read, settings = read_for_bake(context)
    result = engine.finished(engine.bake(read.scene, settings))
    with realised(context, read, settings.resolution) as reference:
        first, second = (reference.bake(samples, seed) for seed in (1, 2))
        used = weight_of(reference.colour()) > 0
    known = known_texels(result, read.scene, settings) & (first[..., 3] > 0)
    used &= known[..., None]
    numbers = materials_of(subdivided(read.scene, settings), len(first))
    by_name = defaultdict(list)
    for number, material in enumerate(read.scene.materials):
        by_name[material.name].append(number)
    rows = {}
    for name, own in by_name.items():
        chosen = np.isin(numbers, own)
        channels = used & chosen[..., None]
        if channels.any():
            ours, one, other = (image[..., :3][channels].mean() for image in (result.display, first, second))
            truth = (one + other) / 2
            noise = abs(one - other) / 2
            rows[name] = int(channels.any(axis=-1).sum()), ours, truth, noise
    return rows


def materials_of(patch_scene, atlases: int) -> np.ndarray:
    """Return the number of each texel's material, (atlases, r, r) int32; -1 without a patch."""
    patches = patch_scene.patches
    numbers = np.full((atlases, patches.resolution**2), -1, np.int32)
    own = patches.atlas < atlases
    material = patch_scene.triangles.material[patch_scene.geometry.triangle]
    numbers[patches.atlas[own], patches.texel[own]] = material[own]
    return numbers.reshape(atlases, patches.resolution, patches.resolution)


if __name__ == "__main__":
    main()
