"""Builds the packages for Blender, a page that lists their contents, and the sizes that the docs quote.

python -m tools.package out/wheels out/package --sizes README.md
"""

from __future__ import annotations

import argparse
from pathlib import Path

from tools.packages.archive import build
from tools.packages.contents import page
from tools.packages.sizes import with_sizes
from tools.packages.wheels import wheels_in


def main() -> None:
    """Replace the contents of the folder."""
    options = parse()
    for old in options.out.glob("*.zip"):
        old.unlink()
    wheels = wheels_in(options.wheels)
    packages = build(wheels, options.out, options.version)
    contents = options.out / "CONTENTS.md"
    contents.write_text(page(packages, wheels), encoding="utf-8", newline="\n")
    for path in options.sizes:
        text = path.read_text(encoding="utf-8")
        path.write_text(with_sizes(text, packages), encoding="utf-8", newline="\n")
    for path in (*packages, contents):
        print(f"{path}  {path.stat().st_size:,} bytes")


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="tools.package", description=__doc__.splitlines()[0])
    parser.add_argument("wheels", type=Path, help="folder of the wheels of all platforms")
    parser.add_argument("out", type=Path, help="folder for the packages")
    parser.add_argument("--version", help="instead of the manifest's")
    parser.add_argument(
        "--sizes", type=Path, action="append", default=[], help="page that quotes the sizes: renew them"
    )
    return parser.parse_args()


if __name__ == "__main__":
    main()
