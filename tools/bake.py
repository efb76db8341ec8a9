"""Bakes the lightmaps of a scene file from a shell, with this checkout.

    python tools/bake.py SCENE --out DIR [--resolution N] [--hemicube N] [--json] ...

SCENE is a .blend, .glb, .gltf or .obj. The add-on's own Bake operator runs in bpy, Blender as a
Python module. Options, JSON and exit codes are those of `blender -c hemibake`, from the same code;
--verify is only here.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from pathlib import Path

from headless import ROOT, blender, load

command = load("operators.command_line.command")
options = load("operators.command_line.options")
signals = load("operators.command_line.signals")


def main(arguments: list[str]) -> int:
    """Run the command and return its exit code."""
    return command.execute_last(arguments, parser(), run)


def parser() -> argparse.ArgumentParser:
    made = options.parser("bake.py", __doc__.splitlines()[0])
    made.add_argument("scene", type=Path, help=".blend, .glb, .gltf or .obj")
    made.add_argument(
        "--verify", type=int, nargs="?", const=256, metavar="SPP",
        help="bake with Cycles, too, so many samples a texel, and tell the difference",
    )  # fmt: skip
    return made


def run(given: argparse.Namespace, listening: signals.Signals) -> dict:
    """Bake in a Blender of its own and return the report."""
    command.check_paths(given)
    with blender(), listening.listening():
        allow_network()
        command.prepare(given)
        if given.verify is not None:
            check_verify(given.verify)
        report = command.write_states(given, command.bake(given, listening))
        report = command.export(given, report)
        if given.verify is not None:
            report["verify"], path = verify_bake(given.verify, given.out.resolve())
            report["files"].append(path)
        return command.save(given, report)


def allow_network() -> None:
    """Allow network access in this process, for the scheduler that the options name."""
    import bpy

    bpy.context.preferences.system.use_online_access = True


def check_verify(samples: int) -> None:
    """Raise CommandError if a bake with the scene's settings cannot be compared with Cycles."""
    import bpy

    if samples < 1:
        raise options.CommandError(f"--verify needs at least 1 sample, not {samples}.")
    if "combined" not in bpy.context.scene.hemibake.outputs:
        raise options.CommandError("--verify compares all light: let 'combined' be among the outputs.")


def verify_bake(samples: int, out: Path) -> tuple[dict, str]:
    """Compare with Cycles; return the figures and the path of a picture of the difference."""
    import bpy

    sys.path.insert(0, str(ROOT))
    from tools.verification.run import verify, write_difference

    found = verify(bpy.context, samples)
    path = out / "difference.png"
    write_difference(found.difference, path)
    return asdict(found.figures) | {"areas": asdict(found.areas)}, str(path)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
