"""Builds the packages for Blender, and a page that lists their contents.

python -m tools.package out/wheels out/package
"""

from __future__ import annotations

import argparse
from pathlib import Path

from tools.packages.archive import build
from tools.packages.contents import page
from tools.packages.wheels import wheels_in


def main() -> None:
    """Replace what is in the folder."""
    options = parse()
    for old in options.out.glob("*.zip"):
        old.unlink()
    wheels = wheels_in(options.wheels)
    packages = build(wheels, options.out, options.version)
    contents = options.out / "CONTENTS.md"
    contents.write_text(page(packages, wheels), encoding="utf-8", newline="\n")
    for path in (*packages, contents):
        print(f"{path}  {path.stat().st_size:,} bytes")


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="tools.package", description=__doc__.splitlines()[0])
    parser.add_argument("wheels", type=Path, help="folder of the wheels of all platforms")
    parser.add_argument("out", type=Path, help="folder for the packages")
    parser.add_argument("--version", help="instead of the manifest's")
    return parser.parse_args()


if __name__ == "__main__":
    main()
