"""Commands of the installed add-on for a shell: `blender -b room.blend -c hemibake --out lightmaps`."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from .command import bake, check_paths, execute_last, export, prepare, save, write_states
from .merge import merge_parser, merge_parts
from .options import parser
from .signals import Signals
from .worker import work

_DESCRIPTION = """Bake the lightmaps of the file that is open, or of a .blend, .glb, .gltf or .obj.
The folder receives an .exr and a .png picture of each lightmap, or the format of --file-format. With --json
the last line on standard output is one JSON object: the report of the bake (exit code 0), or {"error": ...}
(exit code 1; 130 after Ctrl+C, 143 after SIGTERM)."""

_commands: list = []


def register() -> None:
    """Register the commands with Blender."""
    import bpy

    _commands.append(bpy.utils.register_cli_command("hemibake", main))
    _commands.append(bpy.utils.register_cli_command("hemibake_merge", main_of_merge))
    _commands.append(bpy.utils.register_cli_command("hemibake_worker", main_of_worker))


def unregister() -> None:
    """Unregister the commands."""
    import bpy

    while _commands:
        bpy.utils.unregister_cli_command(_commands.pop())


def main(arguments: list[str]) -> int:
    """Run a bake and return the exit code of the process, which ends afterwards."""
    options = parser("blender -c hemibake", _DESCRIPTION)
    options.add_argument(
        "scene", type=Path, nargs="?", help=".blend, .glb, .gltf or .obj; the file that is open without one"
    )
    return execute_last(arguments, options, _bake)


def main_of_merge(arguments: list[str]) -> int:
    """Merge the reports of parts that were baked separately; return the exit code."""
    return execute_last(arguments, merge_parser("blender -c hemibake_merge"), merge_parts)


def main_of_worker(arguments: list[str]) -> int:
    """Work for a scheduler until it ends; return the exit code."""
    return work(arguments, "blender -c hemibake_worker")


def _bake(options: Namespace, signals: Signals) -> dict:
    """Bake and return the report."""
    check_paths(options)
    with signals.listening():
        prepare(options)
        report = write_states(options, bake(options, signals))
        return save(options, export(options, report))
