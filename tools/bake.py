"""Bake the lightmaps of a scene file from a plain shell.

    python tools/bake.py SCENE --out DIR [--resolution N] [--hemicube N] [--json] ...

SCENE is a .blend, .glb, .gltf or .obj. The add-on's own Bake operator runs in bpy, Blender as a
Python module. DIR receives an .exr and a .png picture of each lightmap. With --json the last line on
standard output is one JSON object: what the bake did (exit code 0), or {"error": ...} (exit code 1;
130 after Ctrl+C, 143 after SIGTERM).
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import tempfile
import traceback
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from headless import ROOT, blender, quiet_stdout
from setting_options import add_settings, setting_names
from signals import Signals, Stopped, ignore

if TYPE_CHECKING:
    import bpy


#: Options that set what the add-on adds to the engine's settings.
_OWN = {"uv_layer": "name of the lightmap UV layer"}


class CommandError(Exception):
    """The command cannot do what it was asked to; the message names the remedy."""


class Parser(argparse.ArgumentParser):
    """Leaves it to `main` how an error is told."""

    def error(self, message: str) -> None:
        """Raise instead of ending the process."""
        raise CommandError(f"{message}. See --help.")


def main(arguments: list[str]) -> int:
    """Run the command and return its exit code."""
    as_json = "--json" in arguments
    try:
        with Signals() as signals, quiet_stdout():
            options = parse(arguments)
            result = run(options, signals)
        tell(result, as_json)
    except Stopped as stop:
        tell_error(str(stop), as_json)
        return stop.code
    except (CommandError, OSError, RuntimeError) as error:
        tell_error(str(error).strip().removeprefix("Error: "), as_json)
        return 1
    except Exception as error:  # noqa: BLE001
        traceback.print_exc()
        tell_error(f"This is a bug in Hemibake: {type(error).__name__}: {error}", as_json)
        return 1
    return 0


def parse(arguments: list[str]) -> argparse.Namespace:
    parser = Parser(prog="bake.py", description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("scene", type=Path, help=".blend, .glb, .gltf or .obj")
    parser.add_argument("--out", type=Path, required=True, help="folder for the lightmaps")
    add_settings(parser)
    for name, text in _OWN.items():
        parser.add_argument(f"--{name.replace('_', '-')}", help=text)
    parser.add_argument(
        "--verify", type=int, nargs="?", const=256, metavar="SPP",
        help="bake with Cycles, too, so many samples a texel, and tell the difference",
    )  # fmt: skip
    parser.add_argument("--world", type=colour, metavar="R,G,B", help="replace the world by this radiance")
    parser.add_argument("--save-blend", type=Path, metavar="FILE", help="save the baked scene")
    parser.add_argument("--json", action="store_true", help="end with one JSON object")
    return parser.parse_args(_joined(arguments))


def _joined(arguments: list[str]) -> list[str]:
    """Return the arguments with "--world -1,1,1" as one: argparse takes what starts with - for an option."""
    words = iter(arguments)
    return [f"{word}={next(words, '')}" if word == "--world" else word for word in words]


def colour(text: str) -> tuple[float, float, float]:
    """Return the three numbers of "R,G,B"."""
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != 3 or not all(math.isfinite(value) and value >= 0 for value in values):
        raise argparse.ArgumentTypeError(f"'{text}' is no radiance: give three numbers from 0, such as 1,1,1")
    return values


def run(options: argparse.Namespace, signals: Signals) -> dict:
    """Open the scene, bake it, write everything and return the report."""
    scene, out = options.scene.resolve(), options.out.resolve()
    if scene.is_dir():
        raise CommandError(f"'{scene}' is a folder. Name a scene file in it.")
    opener = OPENERS.get(scene.suffix.lower())
    if opener is None:
        raise CommandError(f"'{scene.name}' is not a scene this can open: use {', '.join(OPENERS)}.")
    if not scene.is_file():
        raise CommandError(f"There is no file '{scene}'.")
    if options.save_blend is not None:
        check_place(options.save_blend.resolve())
    with blender(), signals.heard():
        open_scene(opener, scene)
        signals.check()
        if options.world is not None:
            replace_world(options.world)
        apply_settings(options, out)
        if options.verify is not None:
            check_verify(options.verify)
        report = bake()
        signals.check()
        report["files"] += write_pictures(report["images"], out)
        if options.verify is not None:
            report["verify"], path = verify_bake(options.verify, out)
            report["files"].append(path)
        if options.save_blend is not None:
            report["files"].append(save_blend(options.save_blend.resolve()))
    return report


def open_scene(opener: Callable[[str], None], path: Path) -> None:
    try:
        opener(str(path))
    except RuntimeError as error:
        raise CommandError(f"'{path}' cannot be opened: {error}".strip()) from error


def open_blend(path: str) -> None:
    import bpy

    bpy.ops.wm.open_mainfile(filepath=path, load_ui=False)


def import_gltf(path: str) -> None:
    import bpy

    bpy.ops.import_scene.gltf(filepath=path)


def import_obj(path: str) -> None:
    import bpy

    bpy.ops.wm.obj_import(filepath=path)


OPENERS = {".blend": open_blend, ".glb": import_gltf, ".gltf": import_gltf, ".obj": import_obj}


def replace_world(radiance: tuple[float, float, float]) -> None:
    """Give the scene a constant background."""
    import bpy

    world = bpy.data.worlds.new("World")
    if world.node_tree is None:
        world.use_nodes = True
    background = next(node for node in world.node_tree.nodes if node.bl_idname == "ShaderNodeBackground")
    background.inputs["Color"].default_value = (*radiance, 1.0)
    background.inputs["Strength"].default_value = 1.0
    bpy.context.scene.world = world


def apply_settings(options: argparse.Namespace, out: Path) -> None:
    """Copy the given options to the scene's bake settings."""
    import bpy

    settings = bpy.context.scene.hemibake
    settings.directory = str(out)
    for name in (*setting_names(), *_OWN):
        value = getattr(options, name)
        if value is None:
            continue
        try:
            setattr(settings, name, value)
        except (TypeError, ValueError, OverflowError) as error:
            raise CommandError(refusal(settings.bl_rna.properties[name], value)) from error


def refusal(setting: bpy.types.Property, value: object) -> str:
    """Return why a setting does not take a value."""
    if setting.type == "ENUM":
        choices = ", ".join(setting.enum_items.keys())
        return f"{setting.identifier} is {told(value)}; choose one of {choices}."
    return f"{setting.identifier} is {value}, which is far out of its range."


def told(value: object) -> str:
    """Return the value of an option as it was typed."""
    return ", ".join(sorted(value)) if isinstance(value, set) else str(value)


def bake() -> dict:
    """Run the operator; it raises RuntimeError with its message if it fails."""
    import bpy

    bpy.ops.hemibake.bake()
    return json.loads(bpy.context.scene.hemibake.report)


def write_pictures(images: list[str], out: Path) -> list[str]:
    """Write a picture of each lightmap beside its EXR file and return the paths."""
    import bpy
    from picture import exposed, read_pixels, write_png

    paths = []
    for name in images:
        image = bpy.data.images[name]
        path = out / Path(image.filepath).with_suffix(".png").name
        write_png(exposed(read_pixels(image)), path)
        paths.append(str(path))
    return paths


def check_verify(samples: int) -> None:
    """Raise CommandError if a bake with the scene's settings cannot be compared with Cycles."""
    import bpy

    if samples < 1:
        raise CommandError(f"--verify needs at least 1 sample, not {samples}.")
    if "combined" not in bpy.context.scene.hemibake.outputs:
        raise CommandError("--verify compares all light: let 'combined' be among the outputs.")


def verify_bake(samples: int, out: Path) -> tuple[dict, str]:
    """Compare with Cycles; return the figures and the path of a picture of the difference."""
    import bpy

    sys.path.insert(0, str(ROOT))
    from tools.verification.run import verify, write_difference

    figures, difference, _ = verify(bpy.context, samples)
    path = out / "difference.png"
    write_difference(difference, path)
    return asdict(figures), str(path)


def check_place(path: Path) -> None:
    """Raise CommandError if no file can be written at a path."""
    try:
        if path.is_dir():
            raise IsADirectoryError(f"'{path}' is a folder")
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path.parent):
            writable = not path.exists() or os.access(path, os.W_OK)
        if not writable:
            raise PermissionError(f"'{path}' is read-only")
    except OSError as error:
        raise CommandError(
            f"The scene cannot be saved as '{path}': {error}. Choose another place."
        ) from error


def save_blend(path: Path) -> str:
    import bpy

    path.parent.mkdir(parents=True, exist_ok=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)
    return str(path)


def tell(report: dict, as_json: bool) -> None:
    if as_json:
        print(json.dumps(report, allow_nan=False))
        return
    print(
        f"{report['objects']} objects, {report['patches']} patches, {report['iterations']} iterations, "
        f"{report['seconds']['total']:.1f} s"
    )
    if "verify" in report:
        figures = report["verify"]
        print(
            f"difference to Cycles: RMSE {figures['rmse']:.2%} ({figures['smooth']:.2%} off edges of light), "
            f"bias {figures['bias']:+.2%}, of its mean over {figures['texels']} texels"
        )
    print("\n".join(report["files"]))


def tell_error(message: str, as_json: bool) -> None:
    if as_json:
        print(json.dumps({"error": message}))
    else:
        print(f"Error: {message}", file=sys.stderr)


if __name__ == "__main__":
    code = main(sys.argv[1:])
    ignore()
    sys.exit(code)
