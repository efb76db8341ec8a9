"""Merges the reports and manifests of parts that were baked separately, with this checkout.

    python tools/merge.py FOLDER [--parts NAME ...] [--json]

The options and files are those of `blender -c hemibake_merge`, from the same code.
"""

from __future__ import annotations

import sys

from headless import load

command = load("operators.command_line.command")
merging = load("operators.command_line.merge")


def main(arguments: list[str]) -> int:
    """Merge and return the exit code."""
    return command.execute_last(arguments, merging.merge_parser("merge.py"), merging.merge_parts)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
