"""The command-line bake, run by Blender or by Python with the bpy package.

It controls the add-on through `bpy.ops` and `scene.hemibake`, as any script would. It can be imported without
bpy, so that mistyped options are reported at once.
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

from ...engine.setting_types import PREFERENCES
from ...engine.settings import kept_with_scene, shown_in
from .open_scene import check_scene, open_scene, replace_world
from .options import OWN, CommandError, Parser, parse
from .scene_subset import choose_part
from .signals import Signals, Stopped
from .stdout_guard import end_stdout, quiet_stdout

if TYPE_CHECKING:
    import bpy

#: Suffixes of files that a scene can be exported to.
_EXPORTED = (".glb", ".gltf")

#: Function that bakes by the options and returns the report.
Work = Callable[[argparse.Namespace, Signals], dict]


def execute(arguments: Sequence[str], parser: Parser, work: Work) -> int:
    """Run a command and print its report or error.

    Returns the exit code: 0, 1, or 128 + the number of a signal.
    """
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


def execute_last(arguments: Sequence[str], parser: Parser, work: Work) -> int:
    """Run a command as `execute` does and end the process; JSON is the last line of its output."""
    code = execute(arguments, parser, work)
    if "--json" in arguments:
        end_stdout()
    return code


def check_paths(options: argparse.Namespace) -> None:
    """Raise CommandError if the scene does not exist, or the result could not be saved or exported."""
    if options.scene is not None:
        check_scene(options.scene.resolve())
    if options.export is not None and options.export.suffix.lower() not in _EXPORTED:
        raise CommandError(f"'{options.export.name}' is no name of a glTF file: use {', '.join(_EXPORTED)}.")
    for path in (options.export, options.save_blend, options.report):
        if path is not None:
            _check_place(path.resolve())


def prepare(options: argparse.Namespace) -> None:
    """Open the scene, choose the part to bake, and apply the options for world and settings.

    Raises CommandError, also for a light state that the scene does not have.
    """
    if options.scene is not None:
        open_scene(options.scene.resolve())
    choose_part(options)
    if options.world is not None:
        replace_world(options.world)
    apply_settings(options)
    _apply_sun_path(options)
    options.states = [_state_name(name) for name in options.states]
    _check_states(options.states)


def bake(options: argparse.Namespace, signals: Signals) -> dict:
    """Bake the open scene, write a picture of each lightmap that has none, and return the report."""
    import bpy

    from ..file_format import ENCODED
    from ..result.pictures import write_pictures

    # On failure the operator raises RuntimeError with its message.
    signals.check()
    bpy.ops.hemibake.bake()
    signals.check()
    report = json.loads(bpy.context.scene.hemibake.report)
    if bpy.context.scene.hemibake.file_format not in ENCODED:
        images = [bpy.data.images[name] for name in report["images"]]
        report["files"] += write_pictures(images, options.out.resolve())
    return report


def write_states(options: argparse.Namespace, report: dict) -> dict:
    """Write the lightmaps of the light states that options name; return the report with files and warnings.

    Raises CommandError.
    """
    import bpy

    from ...engine.errors import EngineError
    from ..result.light_states import find_state, missing_groups
    from ..result.state_files import write_state

    scene = bpy.context.scene
    try:
        states = [find_state(scene, name) for name in options.states]
        files = [str(path) for state in states for path in write_state(scene, state)]
    except EngineError as error:
        raise CommandError(str(error)) from error
    warnings = [message for state in states for message in missing_groups(scene, state)]
    return {**report, "files": report["files"] + files, "warnings": report["warnings"] + warnings}


def export(options: argparse.Namespace, report: dict) -> dict:
    """Write a glTF file with the lightmaps if an option requests it; return the report with the file."""
    import bpy

    if options.export is None:
        return report
    path = str(options.export.resolve())
    bpy.ops.hemibake.export_for_engine(filepath=path)
    return {**report, "files": [*report["files"], path]}


def save(options: argparse.Namespace, report: dict) -> dict:
    """Save the baked scene and the report if options request it; return the report with the file."""
    import bpy

    if options.save_blend is not None:
        path = options.save_blend.resolve()
        path.parent.mkdir(parents=True, exist_ok=True)
        bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)
        report = {**report, "files": [*report["files"], str(path)]}
    if options.report is not None:
        options.report.resolve().write_text(json.dumps(report, allow_nan=False, indent=1), encoding="utf-8")
    return report


def _apply_sun_path(options: argparse.Namespace) -> None:
    """Set the sun path of the scene by the options; raises CommandError if one is invalid."""
    import bpy

    from ...engine.errors import EngineError
    from ..scene.sun_path import sun_times

    settings = bpy.context.scene.hemibake
    if options.sun_light is not None:
        lights = [obj for obj in bpy.context.scene.objects if obj.type == "LIGHT"]
        suns = {obj.name: obj for obj in lights if obj.data.type == "SUN"}
        if options.sun_light not in suns:
            listed = ", ".join(f"'{name}'" for name in suns) or "none"
            raise CommandError(
                f"--sun-light is '{options.sun_light}'; choose one of the sun lights: {listed}."
            )
        settings.sun_light = suns[options.sun_light]
    if options.sun_times is not None:
        try:
            settings.sun_times = " ".join(sun_times(" ".join(options.sun_times)))
        except EngineError as error:
            raise CommandError(str(error)) from error
        settings.outputs |= {"combined", "light_groups"} if settings.sun_times else set()
    part = next((name for name in ("collection", "lightmap") if getattr(options, name) is not None), None)
    if part is not None and settings.sun_times and "light_groups" in settings.outputs:
        raise CommandError(
            f"A sun path needs new maps of all objects. Leave out --{part}, or end the path by --sun-path ''."
        )


def _state_name(name: str) -> str:
    """Return the name of a light state; a time is written as a sun path names it, such as 08:00 for 8:00."""
    import bpy

    from ...engine.errors import SettingsError
    from ..scene.sun_path import sun_times

    if name in bpy.context.scene.hemibake.light_states:
        return name
    try:
        return next(iter(sun_times(name)), name)
    except SettingsError:
        return name


def _check_states(names: Sequence[str]) -> None:
    """Raise CommandError for a light state that the scene does not have, or without maps of light groups."""
    import bpy

    from ...engine.errors import EngineError
    from ..result.light_states import find_state
    from ..scene.sun_path import sun_times

    if names and "light_groups" not in bpy.context.scene.hemibake.outputs:
        raise CommandError("--state needs the output Light Groups. Add light_groups to --outputs.")
    try:
        made_by_bake = sun_times(bpy.context.scene.hemibake.sun_times)
        for name in (name for name in names if name not in made_by_bake):
            find_state(bpy.context.scene, name)
    except EngineError as error:
        raise CommandError(str(error)) from error


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


def apply_settings(options: argparse.Namespace) -> None:
    """Copy the given options to the scene's settings and, for this process, to the machine's preferences."""
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
    """Return the preferences of the add-on, whichever repository it was installed from."""
    import bpy

    addons = bpy.context.preferences.addons
    return next(addon.preferences for addon in addons if addon.module.rpartition(".")[2] == "hemibake")


def _apply(settings: bpy.types.bpy_struct, name: str, value: object) -> None:
    """Set a setting to the value of its option; raises CommandError if it is refused."""
    try:
        setattr(settings, name, value)
    except (TypeError, ValueError, OverflowError) as error:
        raise CommandError(_refusal(settings.bl_rna.properties[name], value)) from error


def _refusal(setting: bpy.types.Property, value: object) -> str:
    """Return the reason why a setting refuses a value."""
    if setting.type == "ENUM":
        typed = ", ".join(sorted(value)) if isinstance(value, set) else str(value)
        return f"{setting.identifier} is {typed}; choose one of {', '.join(setting.enum_items.keys())}."
    return f"{setting.identifier} is {value}, which is far out of its range."
