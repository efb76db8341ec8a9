"""Runs Blender with this checkout and reloads the extension after each change of a file.

    python tools/reload_loop.py [--blender /path/to/blender] [FILE.blend]

For work on panels and operators: save a file in the editor, and Blender shows the new panel within a second.
Blender gets user files of its own, which are removed at its end. A file with an error is reported in the
terminal, and the extension stays disabled until the next change. Changes of the engine take effect with the
next baking process.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from headless import MODULE, ROOT, disable, enable, install

#: Time between two checks of the files, s. Chosen: shorter than a switch from the editor to Blender.
_PERIOD = 0.5


class Reloader:
    """Reloads a package once one of its files has changed.

    folders:  folders of its Python files
    package:  name of the package in `sys.modules`
    enable:   imports and registers the package; raises the error of a faulty file
    disable:  unregisters it
    """

    def __init__(
        self,
        folders: Sequence[Path],
        package: str,
        enable: Callable[[], None],
        disable: Callable[[], None],
    ) -> None:
        self._folders, self._package = folders, package
        self._enable, self._disable = enable, disable
        self._times = self._read_times()

    def step(self) -> bool:
        """Reload if a file is new, has changed or is gone; return True if the package is loaded again."""
        times = self._read_times()
        if times == self._times:
            return False
        self._times = times
        return self._reload()

    def _read_times(self) -> dict[Path, int]:
        """Return the time of the last change of each file, ns."""
        times: dict[Path, int] = {}
        for path in (path for folder in self._folders for path in folder.rglob("*.py")):
            try:
                times[path] = path.stat().st_mtime_ns
            except FileNotFoundError:  # an editor is replacing it
                continue
        return times

    def _reload(self) -> bool:
        """Import all modules of the package again; print the error of a file that has one."""
        begin = time.perf_counter()
        try:
            self._disable()
            for name in [name for name in sys.modules if f"{name}.".startswith(f"{self._package}.")]:
                del sys.modules[name]
            self._enable()
        except Exception:  # noqa: BLE001
            traceback.print_exc()
            return False
        print(f"Reloaded in {time.perf_counter() - begin:.2f} s", flush=True)
        return True


def watch() -> None:
    """Enable the checkout in this Blender and reload it after each change, until Blender ends."""
    import bpy

    enable()
    folders = [ROOT / name for name in ("operators", "panels", "engine")]
    reloader = Reloader(folders, MODULE, enable, disable)

    def step() -> float:
        if reloader.step():
            for area in (
                area for window in bpy.context.window_manager.windows for area in window.screen.areas
            ):
                area.tag_redraw()
        return _PERIOD

    bpy.app.timers.register(step, persistent=True)


def main() -> int:
    """Start Blender and return its exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path, nargs="?", help=".blend to open")
    parser.add_argument("--blender", default="blender", help="program; that of the PATH by default")
    options = parser.parse_args()
    if shutil.which(options.blender) is None:
        parser.error(f"There is no program '{options.blender}'. Name Blender with --blender.")
    with tempfile.TemporaryDirectory(prefix="hemibake-") as folder:
        install(Path(folder))
        opened = [str(options.file.resolve())] if options.file else []
        command = [options.blender, *opened, "--python", str(Path(__file__).resolve())]
        return subprocess.run(command, env={**os.environ, "BLENDER_USER_RESOURCES": folder}).returncode


if __name__ == "__main__":
    if "bpy" in sys.modules:
        watch()
    else:
        sys.exit(main())
