"""Stores the arrays of Blender scenes, so that a machine without Blender can measure their bakes.

    python -m benchmarks.scene_arrays FOLDER [--scene living_room gazebo complex house]

Writes FOLDER/NAME.pickle for each scene: what a bake reads at the width of `RESOLUTIONS`. `--arrays` of
`benchmarks.launches` and `benchmarks.checkouts` reads the files. Read only files that you have written.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.options import Options
from benchmarks.stored_scenes import RESOLUTIONS, store_scene

if TYPE_CHECKING:
    from engine import Scene


def main() -> None:
    """Write the arrays of all scenes."""
    options = _parse()
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tools"))
    from tools.headless import blender, quiet_stdout

    options.folder.mkdir(parents=True, exist_ok=True)
    with blender():
        for name in options.scene:
            with quiet_stdout():
                scene = _read(name, options.scenes)
            store_scene(scene, options.folder, name)
            print(f"{name}: {sum(len(mesh.face) for mesh in scene.meshes):,} triangles")


def _read(name: str, folder: Path) -> Scene:
    """Open a scene in Blender and return what a bake would read."""
    import bpy

    from benchmarks.suites.equal_error import open_scene
    from tools.verification.run import read_for_bake

    open_scene(name, folder, RESOLUTIONS[name])
    bpy.context.scene.hemibake.resolution = RESOLUTIONS[name]
    read, _ = read_for_bake(bpy.context)
    scene: Scene = read.scene
    return scene


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder of the files")
    parser.add_argument("--scene", nargs="+", default=list(RESOLUTIONS), choices=RESOLUTIONS)
    parser.add_argument("--scenes", type=Path, default=Path(Options.scenes), help="folder of scene files")
    return parser.parse_args()


if __name__ == "__main__":
    main()
