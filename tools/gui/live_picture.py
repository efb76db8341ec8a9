"""Takes README's pictures of Live: one frame as baked and one after each change.

python -m tools.gui.live_picture out/package/hemibake-VERSION-linux_x64.zip docs/user/pictures/live.png
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from .docs_picture import BUILD_ROOM
from .machines import find_machine
from .pictures import write_picture
from .window import Window

#: Adds a lamp to the room, and shows it.
STAGE = """
scene, view = bpy.context.scene, view3d()
shine = bpy.data.materials["Light"].node_tree.nodes["Principled BSDF"]
shine.inputs["Emission Strength"].default_value = 3
lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
lamp.location, lamp.data.energy, lamp.data.shadow_soft_size = (-0.6, -0.6, 1.5), 22, 0.1
scene.collection.objects.link(lamp)
scene.hemibake.resolution = 128
scene.render.engine, scene.cycles.preview_samples = "CYCLES", 32
scene.render.resolution_y = scene.render.resolution_x
scene.view_settings.view_transform = "Standard"
space = view["area"].spaces.active
space.region_3d.view_perspective, space.shading.type = "CAMERA", "RENDERED"
space.overlay.show_overlays = space.show_gizmo = False
"""

#: Starts Live, whatever the editors show.
START = """
with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
    bpy.ops.hemibake.live("INVOKE_DEFAULT")
"""

#: Changes of the room, one after the other.
CHANGES = (
    "bpy.data.objects['Lamp'].location = (0.6, -0.5, 1.0)",
    "bpy.data.lights['Lamp'].color = (0.25, 0.4, 1.0)",
    "bpy.data.materials['Red'].node_tree.nodes['Principled BSDF'].inputs['Base Color'].default_value"
    " = (0.6, 0.45, 0.03, 1.0)",
    "bpy.data.objects['Tall Box'].location.x = 0.45; bpy.data.objects['Short Box'].location.x = -0.45",
)

RUNNING = "__import__('sys').modules[f'{MODULE}.operators.worker_manager'].owner.running"

#: Opposite corners of the front of the room, world space, metres.
_CORNERS = ((-1.0, -1.0, 2.0), (1.0, -1.0, 0.0))

#: Width of a frame, and of the gap between two frames, pixels.
_SIDE, _GAP = 260, 6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("package", type=Path, help="Hemibake's package for Linux")
    parser.add_argument("picture", type=Path, help="PNG file to write")
    options = parser.parse_args()
    with Window(find_machine(), options.package) as window:
        window.run(BUILD_ROOM + STAGE + START)
        window.wait_for(f"{RUNNING}.following")
        frames = [_frame(window)]
        for change in CHANGES:
            window.run(change)
            frames.append(_frame(window))
    write_picture(_strip(frames), options.picture)


def _frame(window: Window) -> np.ndarray:
    """Return the room as the view shows it once its light has settled, (_SIDE, _SIDE, 3) uint8."""
    window.ask("bpy.context.view_layer.update()")
    window.wait_for(f"{RUNNING}.run.converged")
    picture = window.still_picture()
    (left, top), (right, bottom) = (window.ask(f"pixel_of({corner})") for corner in _CORNERS)
    rows = np.linspace(top, bottom, _SIDE + 1).round().astype(int)
    columns = np.linspace(left, right, _SIDE + 1).round().astype(int)
    return _means(_means(picture, rows, 0), columns, 1).round().astype(np.uint8)


def _means(picture: np.ndarray, edges: np.ndarray, axis: int) -> np.ndarray:
    """Return the means of a picture between edges along an axis."""
    before = np.zeros_like(np.take(picture, [0], axis), float)
    sums = np.concatenate([before, np.cumsum(picture, axis, dtype=float)], axis)
    shape = np.where(np.arange(picture.ndim) == axis, -1, 1)
    return np.diff(np.take(sums, edges, axis), axis=axis) / np.diff(edges).reshape(shape)


def _strip(frames: list[np.ndarray]) -> np.ndarray:
    """Return frames beside each other, with white between them."""
    gap = np.full((_SIDE, _GAP, 3), 255, np.uint8)
    return np.concatenate([part for frame in frames for part in (gap, frame)][1:], axis=1)


if __name__ == "__main__":
    main()
