"""Measures Live in a Blender window: seconds from a change to the first image and to convergence.

python -m tools.gui.live_times out/package/hemibake-VERSION-linux_x64.zip [--rounds 2]

Two rows: nothing draws the image (all editors show text), and a 3D view in Solid shading.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from .docs_picture import BUILD_ROOM
from .live_picture import CHANGES, RUNNING, STAGE, START
from .machines import find_machine
from .window import Window

#: Shows nothing that has to be drawn, or the room in Solid shading without anti-aliasing: done before and
#: after Live has begun, which shows materials.
_VIEWS = {
    "text": ("for area in bpy.context.window_manager.windows[0].screen.areas: area.type = 'TEXT_EDITOR'", ""),
    "solid": (
        "bpy.context.preferences.system.viewport_aa = 'OFF'",
        "view3d()['area'].spaces.active.shading.type = 'SOLID'",
    ),
}

#: Notes when images are shown.
_NOTE_IMAGES = """
import sys, time
shown = sys.modules[f"{MODULE}.operators.result.progress_images"].ProgressImages
shown.times = []
def noted(self, lightmaps, show=shown.show, times=shown.times, clock=time.perf_counter):
    merged = show(self, lightmaps)
    times.append(clock())
    return merged
shown.show = noted
"""

#: Changes the room between two events, and notes when.
_CHANGE = """
import sys, time
shown = sys.modules[f"{{MODULE}}.operators.result.progress_images"].ProgressImages
shown.times.clear()
{change}
shown.begun = time.perf_counter()
"""

#: When images were shown since the change, s.
_TIMES = (
    "[at - shown.begun for shown in [__import__('sys').modules"
    "[f'{MODULE}.operators.result.progress_images'].ProgressImages] for at in shown.times]"
)

#: Longer than any change takes to begin, s.
_PAUSE = 2.0

#: Python statements that undo the changes, one after the other.
_BACK = (
    "bpy.data.objects['Lamp'].location = (-0.6, -0.6, 1.5)",
    "bpy.data.lights['Lamp'].color = (1.0, 1.0, 1.0)",
    "bpy.data.materials['Red'].node_tree.nodes['Principled BSDF'].inputs['Base Color'].default_value"
    " = (0.6, 0.05, 0.03, 1.0)",
    "bpy.data.objects['Tall Box'].location.x = -0.3; bpy.data.objects['Short Box'].location.x = 0.3",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("package", type=Path, help="Hemibake's package for Linux")
    parser.add_argument("--rounds", type=int, default=2, help="of all changes, there and back")
    options = parser.parse_args()
    print("| view | first image, s | settled, s |\n|---|---|---|")
    for name, (before, after) in _VIEWS.items():
        with Window(find_machine(), options.package) as window:
            window.run(BUILD_ROOM + STAGE)
            window.run(_NOTE_IMAGES + before)
            window.run(START)
            window.wait_for(f"{RUNNING}.following")
            window.run(after)
            times = [_times(window, change) for _ in range(options.rounds) for change in (*CHANGES, *_BACK)]
        columns = np.array(times).T
        figures = " | ".join(f"{np.median(column):.2f} (at most {column.max():.2f})" for column in columns)
        print(f"| {name} | {figures} |", flush=True)


def _times(window: Window, change: str) -> tuple[float, float]:
    """Change the room; return the seconds to its first image and to its last one."""
    window.wait_for(f"{RUNNING}.run.converged")
    window.run(_CHANGE.format(change=change))
    time.sleep(_PAUSE)
    window.wait_for(f"{RUNNING}.run.converged")
    shown = window.ask(_TIMES)
    return shown[0], shown[-1]


if __name__ == "__main__":
    main()
