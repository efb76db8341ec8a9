"""Renders exported scenes with Godot 4.6, in a window on a virtual screen.

Mesa draws, so no graphics card is needed. Godot imports the files into a project of its own, and a script
(show.gd) opens the exported scene.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from tools.gui.machines import Machine

HERE = Path(__file__).parent

#: Folder of a Debian with Godot and Xvfb, for machines whose own Godot is older or missing.
_ROOT = Path(os.environ.get("HEMIBAKE_GODOT_ROOT", "/var/cache/hemibake/sid"))

_PROGRAMS = ("godot", "xvfb-run")

#: Oldest version whose lightmaps hold packed spherical harmonics.
_VERSION = (4, 6)

#: Longest time that importing or drawing may take, s.
_PATIENCE = 600

#: Folder of the exported files in the project, and of the add-on.
_LEVEL, _ADDON = "levels/one", "addons/hemibake"

#: Blender filters lightmaps between four texels, Godot by default between sixteen. Godot by default fades the
#: light of an object that has moved.
_PROJECT = """config_version=5
[application]
config/name="Show"
config/features=PackedStringArray("4.6")
[editor_plugins]
enabled=PackedStringArray({plugins})
[rendering]
renderer/rendering_method="gl_compatibility"
lightmapping/lightmap_gi/use_bicubic_filter={bicubic}
lightmapping/probe_capture/update_speed=1000000.0
"""


def missing() -> str:
    """Return what a render needs that is missing, and how to install it; "" if all is there."""
    if _machine() is None:
        return (
            f"Godot {_VERSION[0]}.{_VERSION[1]} or newer with xvfb-run is not installed (Debian sid: apt "
            f"install godot xvfb; as root also in the folder {_ROOT} by debootstrap)"
        )
    return ""


def render(
    path: Path,
    width: int,
    height: int,
    hide: tuple[str, ...] = (),
    bicubic: bool = False,
    state: str = "",
    **options: object,
) -> np.ndarray:
    """Render a scene through its camera with Godot; return (h, w, 3) float32, linear, bottom row first.

    path:     a .tscn, .glb or .gltf file; all files of its folder are imported
    hide:     names of nodes that are not shown
    bicubic:  True to filter lightmaps as Godot does by default
    state:    light state that is shown; empty for the lightmaps themselves
    options:  further keys of show.gd, or "addon": folder of the add-on

    Raises RuntimeError if Godot draws nothing.
    """
    asked = {"width": width, "height": height, "hidden": hide, **options}
    if state:
        asked["data"] = f"{_LEVEL}/{path.stem}.{state}.NODE.tres"
    return _pictures(path, asked, bicubic)[0]


def render_path(
    path: Path,
    width: int,
    height: int,
    moved: str,
    places: Sequence[Sequence[float]],
    hide: tuple[str, ...] = (),
    **options: object,
) -> np.ndarray:
    """Render a scene with a dynamic object at some places; return (n, h, w, 3) float32, as `render`.

    moved:    name of the object's node
    places:   its positions, y up, m
    options:  further keys of show.gd
    """
    asked = {"width": width, "height": height, "hidden": hide, "moved": moved, "places": places, **options}
    return _pictures(path, asked, bicubic=False)


def _pictures(path: Path, asked: dict, bicubic: bool) -> np.ndarray:
    """Return the pictures that show.gd draws of a scene, (n, h, w, 3) float32, bottom row first.

    asked:  question for show.gd; "addon": folder of the add-on
    """
    machine, addon = _machine(), asked.pop("addon", None)
    with _project(machine) as project:
        plugins = f'"res://{_ADDON}/plugin.cfg"' if addon else ""
        settings = _PROJECT.format(plugins=plugins, bicubic=str(bicubic).lower())
        (project / "project.godot").write_text(settings, encoding="utf-8")
        shutil.copytree(path.parent, project / _LEVEL)
        if addon:
            shutil.copytree(addon, project / _ADDON)
        shutil.copy2(HERE / "show.gd", project)
        asked = {"file": f"{_LEVEL}/{path.name}", **asked}
        (project / "show.json").write_text(json.dumps(asked), encoding="utf-8")
        inside = str(Path("/") / project.relative_to(machine.root))
        told = _run(machine, project, "godot", "--headless", "--path", inside, "--import")
        drawing = ("--rendering-method", "gl_compatibility", "--rendering-driver", "opengl3")
        told += _run(
            machine, project, "xvfb-run", "-a", "godot", *drawing, "--audio-driver", "Dummy",
            "--path", inside, "--script", "show.gd",
        )  # fmt: skip
        pixels = project / "pixels.bin"
        if not pixels.is_file():
            raise RuntimeError(f"Godot has drawn nothing: {told[-3000:]}")
        shape = -1, asked["height"], asked["width"], 4
        return np.fromfile(pixels, np.float32).reshape(shape)[:, ::-1, :, :3].copy()


def read_ktx2(data: bytes) -> np.ndarray:
    """Return the texels that Godot reads from a KTX2 file, one mip level after the other, (n, 3) float32.

    Raises RuntimeError if Godot cannot read the file.
    """
    machine = _machine()
    with _project(machine) as project:
        (project / "project.godot").write_text(_PROJECT.format(plugins="", bicubic="false"), encoding="utf-8")
        (project / "texture.ktx2").write_bytes(data)
        shutil.copy2(HERE / "read_ktx.gd", project)
        inside = str(Path("/") / project.relative_to(machine.root))
        told = _run(machine, project, "godot", "--headless", "--path", inside, "--script", "read_ktx.gd")
        texels = project / "texels.bin"
        if not texels.is_file():
            raise RuntimeError(f"Godot has not read the file: {told[-3000:]}")
        return np.fromfile(texels, np.float32).reshape(-1, 4)[:, :3].copy()


def faults(addon: Path, script: str) -> str:
    """Return the messages of Godot's parser on a script of an add-on; empty if it has no faults."""
    machine = _machine()
    with _project(machine) as project:
        (project / "project.godot").write_text(_PROJECT.format(plugins="", bicubic="false"), encoding="utf-8")
        shutil.copytree(addon, project / _ADDON)
        inside = str(Path("/") / project.relative_to(machine.root))
        told = _run(
            machine, project, "godot", "--headless", "--path", inside,
            "--check-only", "--script", f"res://{_ADDON}/{script}",
        )  # fmt: skip
    return "\n".join(line for line in told.splitlines() if "ERROR" in line)


def _machine() -> Machine | None:
    """Return a system with a Godot that is new enough; None without one."""
    if all(shutil.which(program) for program in _PROGRAMS) and _is_new(Machine(Path("/"))):
        return Machine(Path("/"))
    installed = all((_ROOT / "usr" / "bin" / program).exists() for program in _PROGRAMS)
    if installed and os.geteuid() == 0 and _is_new(Machine(_ROOT)):
        return Machine(_ROOT)
    return None


def _is_new(machine: Machine) -> bool:
    """Return True if Godot starts and has at least the required version."""
    done = subprocess.run(machine.command("godot", "--version"), capture_output=True, text=True)
    parts = done.stdout.strip().split(".")[:2]
    return len(parts) == len(_VERSION) and tuple(int(part) for part in parts if part.isdigit()) >= _VERSION


@contextmanager
def _project(machine: Machine) -> Iterator[Path]:
    """Make an empty folder in a system, and remove it at the end."""
    folder = Path(tempfile.mkdtemp(prefix="hemibake-godot-", dir=machine.root / "tmp"))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _run(machine: Machine, project: Path, *command: str) -> str:
    """Run a command that keeps its settings and caches in a project; return its messages."""
    done = subprocess.run(
        machine.command("env", *_environment(machine, project), *command),
        timeout=_PATIENCE, capture_output=True, text=True, errors="replace",
    )  # fmt: skip
    return done.stdout + done.stderr


def _environment(machine: Machine, project: Path) -> Iterator[str]:
    """Yield variables by which Godot keeps settings and caches in a project, and Mesa draws."""
    home = str(Path("/") / project.relative_to(machine.root) / ".home")
    for name in ("HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_CACHE_HOME"):
        yield f"{name}={home}"
    yield "LIBGL_ALWAYS_SOFTWARE=1"
