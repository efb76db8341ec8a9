"""What baking from a shell does, whether Blender runs the command or a Python with bpy does.

It drives the add-on through `bpy.ops` and `scene.hemibake`, as any script would. It is imported before
there is a bpy, so that a mistyped option is told at once.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ...engine.setting import PREFERENCES
from ...engine.settings import kept_with_scene, shown_in
from .options import OWN, CommandError, Parser, parse
from .part import choose_part
from .quiet import quiet_stdout
from .signals import Signals, Stopped

if TYPE_CHECKING:
    import bpy

#: Bakes what the options say and returns the report.
Work = Callable[[argparse.Namespace, Signals], dict]


def execute(arguments: Sequence[str], parser: Parser, work: Work) -> int:
    """Run a command, print what came of it, and return the exit code: 0, 1, or 128 + number of a signal."""
    as_json = "--json" in arguments
    try:
        with Signals() as signals:
            options = parse(parser, arguments)
            with quiet_stdout():
                report = work(options, signals)
        _tell(report, as_json)
    except Stopped as stop:
        _tell_error(str(stop), as_json)
        return stop.code
    except (CommandError, OSError, RuntimeError) as error:
        _tell_error(str(error).strip().removeprefix("Error: "), as_json)
        return 1
    except Exception as error:  # noqa: BLE001
        traceback.print_exc()
        _tell_error(f"This is a bug in Hemibake: {type(error).__name__}: {error}", as_json)
        return 1
    return 0


def check_paths(options: argparse.Namespace) -> None:
    """Raise CommandError if there is no such scene, or the baked one could not be saved or exported."""
    if options.scene is not None:
        _check_scene(options.scene.resolve())
    if options.export is not None and options.export.suffix.lower() not in _EXPORTED:
        raise CommandError(f"'{options.export.name}' is no name of a glTF file: use {', '.join(_EXPORTED)}.")
    for path in (options.export, options.save_blend, options.report):
        if path is not None:
            _check_place(path.resolve())


def prepare(options: argparse.Namespace) -> None:
    """Open what is named, all of it or a part, and give it the world and the settings of the options."""
    if options.scene is not None:
        _open_scene(options.scene.resolve())
    choose_part(options)
    if options.world is not None:
        replace_world(options.world)
    apply_settings(options)


def bake(options: argparse.Namespace, signals: Signals) -> dict:
    """Bake the open scene, write a picture of each lightmap that has none, and return the report."""
    import bpy

    from ..file_format import ENCODED
    from .pictures import write_pictures

    # The operator raises RuntimeError with its message if it fails.
    signals.check()
    bpy.ops.hemibake.bake()
    signals.check()
    report = json.loads(bpy.context.scene.hemibake.report)
    if bpy.context.scene.hemibake.file_format not in ENCODED:
        images = [bpy.data.images[name] for name in report["images"]]
        report["files"] += write_pictures(images, options.out.resolve())
    return report


def export(options: argparse.Namespace, report: dict) -> dict:
    """Write a glTF file with the lightmaps if that is asked for; return the report, with the file."""
    import bpy

    if options.export is None:
        return report
    path = str(options.export.resolve())
    bpy.ops.hemibake.export_for_engine(filepath=path)
    return {**report, "files": [*report["files"], path]}


def save(options: argparse.Namespace, report: dict) -> dict:
    """Save the baked scene and the report if that is asked for; return the report, with the scene's file."""
    import bpy

    if options.save_blend is not None:
        path = options.save_blend.resolve()
        path.parent.mkdir(parents=True, exist_ok=True)
        bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)
        report = {**report, "files": [*report["files"], str(path)]}
    if options.report is not None:
        options.report.resolve().write_text(json.dumps(report, allow_nan=False, indent=1), encoding="utf-8")
    return report


def _check_scene(scene: Path) -> None:
    if scene.is_dir():
        raise CommandError(f"'{scene}' is a folder. Name a scene file in it.")
    if scene.suffix.lower() not in _OPENERS:
        raise CommandError(f"'{scene.name}' is not a scene this can open: use {', '.join(_OPENERS)}.")
    if not scene.is_file():
        raise CommandError(f"There is no file '{scene}'.")


def _check_place(path: Path) -> None:
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
        raise CommandError(f"Nothing can be written to '{path}': {error}. Choose another path.") from error


def _open_scene(path: Path) -> None:
    try:
        _OPENERS[path.suffix.lower()](str(path))
    except RuntimeError as error:
        raise CommandError(f"'{path}' cannot be opened: {error}".strip()) from error


def _open_blend(path: str) -> None:
    import bpy

    bpy.ops.wm.open_mainfile(filepath=path, load_ui=False)


def _import_gltf(path: str) -> None:
    import bpy

    _start_empty()
    bpy.ops.import_scene.gltf(filepath=path)


def _import_obj(path: str) -> None:
    import bpy

    _start_empty()
    bpy.ops.wm.obj_import(filepath=path)


def _start_empty() -> None:
    """Leave the open file for an empty one: a scene that is imported is baked alone."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


#: Endings of files that a scene can be exported to, and what opens each kind of scene.
_EXPORTED = (".glb", ".gltf")
_OPENERS = {".blend": _open_blend, ".glb": _import_gltf, ".gltf": _import_gltf, ".obj": _import_obj}


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


def apply_settings(options: argparse.Namespace) -> None:
    """Copy the given options to the settings of the scene and, for this process, of the machine."""
    import bpy

    scene = bpy.context.scene.hemibake
    scene.directory = str(options.out.resolve())
    given = {name: value for name, value in vars(options).items() if value is not None}
    if "resolution" in given:
        scene.size_mode = "SIZE"
    if "texels_per_metre" in given:
        scene.size_mode = "DENSITY"
    for name in [name for name in ("quality", *kept_with_scene(), *OWN) if name in given]:
        _apply(scene, name, given[name])
    for name in given.keys() & set(shown_in(PREFERENCES)):
        _apply(_preferences(), name, given[name])


def _preferences() -> bpy.types.AddonPreferences:
    """Return the preferences of the add-on, whichever repository it has been installed from."""
    import bpy

    addons = bpy.context.preferences.addons
    return next(addon.preferences for addon in addons if addon.module.rpartition(".")[2] == "hemibake")


def _apply(settings: bpy.types.bpy_struct, name: str, value: object) -> None:
    """Give a setting the value of its option."""
    try:
        setattr(settings, name, value)
    except (TypeError, ValueError, OverflowError) as error:
        raise CommandError(_refusal(settings.bl_rna.properties[name], value)) from error


def _refusal(setting: bpy.types.Property, value: object) -> str:
    """Return why a setting does not take a value."""
    if setting.type == "ENUM":
        typed = ", ".join(sorted(value)) if isinstance(value, set) else str(value)
        return f"{setting.identifier} is {typed}; choose one of {', '.join(setting.enum_items.keys())}."
    return f"{setting.identifier} is {value}, which is far out of its range."


def _tell(report: dict, as_json: bool) -> None:
    if as_json:
        _print(json.dumps(report, allow_nan=False))
        return
    _print(
        f"{report['objects']} objects, {report['patches']} patches, {report['iterations']} iterations, "
        f"{report['seconds']['total']:.1f} s"
    )
    if "verify" in report:
        figures = report["verify"]
        _print(
            f"difference to Cycles: RMSE {figures['rmse']:.2%} ({figures['smooth']:.2%} off edges of light), "
            f"bias {figures['bias']:+.2%}, of its mean over {figures['texels']} texels"
        )
        areas = figures["areas"]
        _print(
            f"difference to the means of what Cycles bakes within texels: RMSE {areas['rmse']:.2%} "
            f"({areas['smooth']:.2%} off edges of light)"
        )
    _print("\n".join(report["files"]))


def _tell_error(message: str, as_json: bool) -> None:
    if as_json:
        _print(json.dumps({"error": message}))
    else:
        print(f"Error: {message}", file=sys.stderr)  # noqa: T201


def _print(text: str) -> None:
    print(text, flush=True)  # noqa: T201
