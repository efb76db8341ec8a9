"""Renders exported files with Godot 3, in a window on a virtual screen.

Mesa draws, so no graphics card is needed. Godot imports the file into a project of its own, and a script
(show.gd) gives its surfaces the shader of docs/engines/godot.md.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from .exported_maps import glb_json
from .question import ask

HERE = Path(__file__).parent

#: Longest time that importing or drawing may take, s.
_PATIENCE = 300

_PROJECT = """config_version=4

[application]

config/name="Show"

[rendering]

quality/driver/driver_name="GLES3"
environment/default_clear_color=Color( 0, 0, 0, 1 )
"""


def missing() -> str:
    """Return what is not there that a render takes, and how to install it; "" if all is."""
    for name, package in (("godot3", "godot3"), ("godot3-server", "godot3-server"), ("Xvfb", "xvfb")):
        if shutil.which(name) is None:
            return f"{name} is not installed (Debian 12: apt install {package})"
    return ""


def render(
    path: Path, width: int, height: int, hide: tuple[str, ...] = (), directional: bool = False
) -> np.ndarray:
    """Return what Godot shows through a file's camera, (h, w, 3) float32, linear, bottom row first.

    path:         a .glb file without lightmaps in it, with OpenEXR files and hemibake.json beside it
    hide:         names of nodes that are not shown
    directional:  shade normal maps with the maps of the output Directional

    Raises RuntimeError if Godot shows nothing.
    """
    with tempfile.TemporaryDirectory(prefix="hemibake-godot-", ignore_cleanup_errors=True) as folder:
        project = Path(folder)
        (project / "project.godot").write_text(_PROJECT, encoding="utf-8")
        ask(project, HERE / "show.gd", path, (width, height), hide, directional, shine=_emission(path))
        _import(project)
        pixels = project / "pixels.bin"
        with _display() as display:
            told = _draw(project, display)
        if not pixels.is_file():
            raise RuntimeError(f"Godot has drawn nothing: {told[-2000:]}")
        return np.fromfile(pixels, np.float32).reshape(height, width, 4)[..., :3].copy()


def _import(project: Path) -> None:
    """Let the editor import what is in a project; it may not end by itself."""
    command = ["godot3-server", "--path", str(project), "--editor", "--quit"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, env=_environment(project), **quiet) as editor:
        try:
            waited = time.monotonic() + _PATIENCE
            while editor.poll() is None and not list(project.glob(".import/*.glb-*.md5")):
                if time.monotonic() > waited:
                    raise RuntimeError("Godot has not imported the file.")
                time.sleep(0.1)
        finally:
            editor.kill()


def _draw(project: Path, display: str) -> str:
    """Run the script of a project; return what Godot tells."""
    command = ["godot3", "--audio-driver", "Dummy", "--path", str(project), "--script", "show.gd"]
    environment = _environment(project) | {"DISPLAY": display, "LIBGL_ALWAYS_SOFTWARE": "1"}
    done = subprocess.run(
        command, env=environment, timeout=_PATIENCE, capture_output=True, text=True, errors="replace"
    )
    return done.stdout + done.stderr


@contextmanager
def _display() -> Iterator[str]:
    """Start a display that nobody sees; yields its name."""
    command = ["Xvfb", "-displayfd", "1", "-screen", "0", "640x480x24", "-nolisten", "tcp"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        try:
            yield f":{server.stdout.readline().strip()}"
        finally:
            server.terminate()


def _environment(project: Path) -> dict[str, str]:
    """Return an environment in which Godot keeps settings and caches in a project."""
    folders = {name: str(project) for name in ("HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_CACHE_HOME")}
    return {**os.environ, **folders}


def _emission(path: Path) -> dict[str, list[float]]:
    """Return the linear emission of each material of a .glb file, by its name."""
    emission = {}
    for material in glb_json(path)["materials"]:
        strength = material.get("extensions", {}).get("KHR_materials_emissive_strength", {})
        factor = strength.get("emissiveStrength", 1.0)
        emission[material["name"]] = [factor * part for part in material.get("emissiveFactor", (0, 0, 0))]
    return emission
