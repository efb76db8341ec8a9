"""Renders exported files with Bevy, without a window.

Mesa's lavapipe draws, so no graphics card is needed. The program is in bevy_show; cargo builds it once, in
a quarter of an hour on two cores.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from .exported_maps import glb_json
from .question import ask

HERE = Path(__file__).parent
SOURCE = HERE / "bevy_show"

#: Where cargo builds the program.
BUILT = HERE.parents[1] / "out" / "engines" / "bevy"

#: Where the loader of Vulkan looks for drivers: variables that name them, and folders.
_DRIVER_VARIABLES = ("VK_DRIVER_FILES", "VK_ICD_FILENAMES")
_DRIVER_FOLDERS = ("/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/usr/share/vulkan/icd.d")

#: Longest time that drawing may take, s.
_PATIENCE = 300

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
    command = ["cargo", "build", "--manifest-path", str(SOURCE / "Cargo.toml")]
    subprocess.run(command, env={**os.environ, "CARGO_TARGET_DIR": str(BUILT)}, check=True)


def render(
    path: Path, width: int, height: int, hide: tuple[str, ...] = (), directional: bool = False
) -> np.ndarray:
    """Render a file through its camera with Bevy; return (h, w, 3) float32, linear, bottom row first.

    path:         a .glb file without lightmaps in it, with OpenEXR files and hemibake.json beside it
    hide:         names of nodes that are not shown
    directional:  shade normal maps with the maps of the output Directional

    Raises RuntimeError if Bevy shows nothing.
    """
    with tempfile.TemporaryDirectory(prefix="hemibake-bevy-") as folder:
        assets = Path(folder)
        shader = SOURCE / "src" / "directional.wgsl"
        ask(assets, shader, path, (width, height), hide, directional, **_camera(path))
        done = subprocess.run(
            [str(BUILT / "debug" / "show"), folder], timeout=_PATIENCE, capture_output=True, text=True
        )
        pixels = assets / "pixels.bin"
        if not pixels.is_file():
            raise RuntimeError(f"Bevy has drawn nothing: {(done.stdout + done.stderr)[-2000:]}")
        return _picture(pixels.read_bytes(), width, height)


def _camera(path: Path) -> dict[str, str | float]:
    """Return the name and the vertical field of view, radians, of a .glb file's first camera."""
    known = glb_json(path)
    node = next(node for node in known["nodes"] if "camera" in node)
    return {"camera": node["name"], "fov": known["cameras"][node["camera"]]["perspective"]["yfov"]}


def _picture(data: bytes, width: int, height: int) -> np.ndarray:
    """Return half floats, top row first, whose rows may be longer than the picture, as (h, w, 3) float32."""
    row = width * _PIXEL if len(data) == width * height * _PIXEL else -(-width * _PIXEL // _ROW) * _ROW
    rows = np.frombuffer(data, np.float16).reshape(height, row // 2)[::-1, : 4 * width]
    return rows.reshape(height, width, 4)[..., :3].astype(np.float32)
