"""Renders exported files with Bevy, without a window.

Mesa's lavapipe draws, so no graphics card is needed. The program is in bevy_show; cargo builds it once, in
a quarter of an hour on two cores.
"""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from .web import Shown

HERE = Path(__file__).parent
SOURCE = HERE / "bevy_show"

#: The crate that the program uses.
CRATE = HERE.parents[1] / "clients" / "bevy"

#: Where cargo builds the program.
BUILT = Path(os.environ.get("CARGO_TARGET_DIR", HERE.parents[1] / "out" / "engines" / "bevy"))

#: Options of the program: a light group as [name, linear RGB, strength]; settings of the crate; whether it
#: reads Radiance HDR in the file; whether it uses features of phones alone; exposure of the camera; manifest
#: of light probes in the folder of the file; radiance where nothing is shown.
_ASKED = {
    "group": None, "shades_normal_maps": True, "prefers_files": False, "hdr_inside": False,
    "is_limited": False, "bicubic": False, "ev100": 9.7, "probes": "",
    "background": (0.0, 0.0, 0.0),
}  # fmt: skip

#: Where the loader of Vulkan looks for drivers: variables that name them, and folders.
_DRIVER_VARIABLES = ("VK_DRIVER_FILES", "VK_ICD_FILENAMES")
_DRIVER_FOLDERS = ("/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/usr/share/vulkan/icd.d")

#: Longest time that drawing may take, s.
_PATIENCE = 600

#: Rows of textures are copied to multiples of this, bytes; a pixel has four half floats.
_ROW, _PIXEL = 256, 8


def missing() -> str:
    """Return the missing requirements of a render, and how to install them; empty if all are installed."""
    if shutil.which("cargo") is None:
        return "cargo is not installed, which builds Bevy 0.18 with Rust 1.89 or newer"
    try:
        ctypes.CDLL("libvulkan.so.1")
    except OSError:
        return "Vulkan is not installed (Debian: apt install libvulkan1 mesa-vulkan-drivers)"
    if not _has_driver():
        return "Vulkan has no driver (Debian: apt install mesa-vulkan-drivers)"
    return ""


def _has_driver() -> bool:
    """Return whether a driver of Vulkan is named where its loader looks for them."""
    if any(os.environ.get(name) for name in _DRIVER_VARIABLES):
        return True
    return any(driver for folder in _DRIVER_FOLDERS for driver in Path(folder).glob("*.json"))


def install() -> None:
    """Let cargo build the program; raises CalledProcessError."""
    cargo(SOURCE, "build")


def cargo(folder: Path, *arguments: str) -> None:
    """Run cargo on the package in a folder; raises CalledProcessError."""
    flags = {"CARGO_TARGET_DIR": str(BUILT), "RUSTDOCFLAGS": "-D warnings"}
    subprocess.run(["cargo", *arguments], cwd=folder, env={**os.environ, **flags}, check=True)


def show(
    path: Path,
    width: int,
    height: int,
    hide: tuple[str, ...] = (),
    state: str = "",
    seconds: float = 0.0,
    **options: object,
) -> Shown:
    """Render a file through its camera with Bevy and the crate bevy_hemibake.

    path:     a .glb file; the maps and hemibake.json are beside it
    hide:     names of nodes that are not shown
    state:    light state; empty for the light of all groups
    seconds:  duration of the fade to it
    options:  other values for keys of _ASKED

    Raises RuntimeError if Bevy shows nothing.
    """
    with tempfile.TemporaryDirectory(prefix="hemibake-bevy-") as made:
        folder = Path(made)
        asked = {
            **_ASKED, **options, "assets": str(path.parent.resolve()), "file": path.name,
            "size": (width, height), "camera": _camera(path), "hidden": hide, "state": state,
            "seconds": seconds,
        }  # fmt: skip
        (folder / "show.json").write_text(json.dumps(asked), encoding="utf-8")
        done = subprocess.run(
            [str(BUILT / "debug" / "show"), made], timeout=_PATIENCE, capture_output=True, text=True
        )
        pixels, problems = folder / "pixels.bin", folder / "problems.json"
        if not pixels.is_file():
            raise RuntimeError(f"Bevy has drawn nothing: {(done.stdout + done.stderr)[-2000:]}")
        told = json.loads(problems.read_text(encoding="utf-8")) if problems.is_file() else []
        return Shown(_picture(pixels.read_bytes(), width, height), told)


def _camera(path: Path) -> str:
    """Return the name of a .glb file's first node with a camera (glTF 2.0, section 4.4)."""
    data = path.read_bytes()
    known = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    return next(node["name"] for node in known["nodes"] if "camera" in node)


def _picture(data: bytes, width: int, height: int) -> np.ndarray:
    """Return half floats, top row first, whose rows may be longer than the picture, as (h, w, 3) float32."""
    row = width * _PIXEL if len(data) == width * height * _PIXEL else -(-width * _PIXEL // _ROW) * _ROW
    rows = np.frombuffer(data, np.float16).reshape(height, row // 2)[::-1, : 4 * width]
    return rows.reshape(height, width, 4)[..., :3].astype(np.float32)
