"""Bakes a scene and prints the result of each stage for one texel of a lightmap.

    python tools/debug_texel.py SCENE LIGHTMAP X Y [options of tools/bake.py]

X and Y are column and row of the texel; row 0 is the bottom row, as in Blender's Image Editor. No file is
written. docs/dev/tracing_a_texel.md explains the output.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import replace
from importlib import import_module
from pathlib import Path

from headless import MODULE, ROOT, blender, load

sys.path.insert(0, str(ROOT))

command = load("operators.command_line.command")
options = load("operators.command_line.options")


def parser() -> argparse.ArgumentParser:
    """Return the parser of the options."""
    made = options.parser("debug_texel.py", __doc__.splitlines()[0])
    made.add_argument("scene", type=Path, help=".blend, .glb, .gltf or .obj")
    made.add_argument("name", metavar="LIGHTMAP", help="name of the lightmap")
    made.add_argument("x", type=int, help="column of the texel")
    made.add_argument("y", type=int, help="row of the texel, 0 is the bottom row")
    return made


def trace(given: argparse.Namespace) -> list[str]:
    """Bake and return the lines of the trace; raises CommandError if there is no such lightmap or texel."""
    import bpy

    from tools.verification.run import read_for_bake

    engine, tracing = import_module(f"{MODULE}.engine"), import_module(f"{MODULE}.engine.texel_trace")
    read, settings = read_for_bake(bpy.context)
    if given.name not in read.scene.atlases:
        raise options.CommandError(
            f"There is no lightmap '{given.name}'. The scene has {', '.join(read.scene.atlases)}."
        )
    texel, lines = tracing.Texel(read.scene.atlases.index(given.name), given.x, given.y), list[str]()
    session = engine.Session()
    bake = session.bake(
        read.scene,
        replace(settings, scheduler="", intermediates=False),
        inspect=lambda state: lines.extend(tracing.trace_texel(state, texel)),
    )
    try:
        engine.finished(bake)
    except IndexError as error:
        raise options.CommandError(str(error)) from error
    finally:
        session.close()
    return lines


def main(arguments: list[str]) -> int:
    """Print the trace and return the exit code: 0, or 1 after an error, which names the remedy."""
    with tempfile.TemporaryDirectory(prefix="hemibake-") as folder:
        try:
            given = options.parse(parser(), ["--out", folder, *arguments])
            command.check_paths(given)
            with blender():
                command.prepare(given)
                lines = trace(given)
        except (options.CommandError, RuntimeError) as error:
            print(f"Error: {error}", file=sys.stderr)
            return 1
    print("\n".join(lines))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
