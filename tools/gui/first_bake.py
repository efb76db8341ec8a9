"""Takes pictures and times of the first bake of a new user: install, stages, first light, final preview.

python -m tools.gui.first_bake out/package/hemibake-VERSION-linux_x64.zip out/first_bake [--opencl none|mesa]

Home is empty, nothing is cached, and there is no network. The folder gets numbered PNG files and times.md.
HEMIBAKE_GUI_ROOT chooses another system, see tools/gui/machines.py.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from contextlib import suppress
from pathlib import Path

import numpy as np

from .docs_picture import BUILD_ROOM
from .machines import find_machine
from .pictures import write_picture
from .window import Window

#: Time from the first look at the panel to the click, and between two looks at the bake, s.
_READING, _POLL = 10.0, 0.25

#: How often the button is looked for, and time for Blender to take a click, s.
_TRIES, _REACTION = 5, 1.0

#: Room with a lamp; the view shows it from its camera.
_STAGE = (
    BUILD_ROOM
    + """
lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
lamp.location, lamp.data.energy, lamp.data.shadow_soft_size = (-0.6, -0.6, 1.5), 20, 0.1
bpy.context.scene.collection.objects.link(lamp)
bpy.context.scene.view_settings.view_transform = "Standard"
view3d()["area"].spaces.active.region_3d.view_perspective = "CAMERA"
shading = view3d()["area"].spaces.active.shading
shading.type, shading.show_backface_culling = "SOLID", True
"""
)

#: Preferences with the installed package in place of the 3D view.
_PREFERENCES = """
area, window = view3d()["area"], bpy.context.window_manager.windows[0]
bpy.context.preferences.active_section = "EXTENSIONS"
area.type = "PREFERENCES"
"""

_INSTALL = """
window = bpy.context.window_manager.windows[0]
with bpy.context.temp_override(window=window):
    bpy.ops.extensions.package_install_files(
        repo="user_default", filepath=PACKAGE, enable_on_install=True, overwrite=True
    )
    bpy.context.preferences.active_section = "ADDONS"
    window_manager = bpy.context.window_manager
    window_manager.addon_search = "Hemibake"
    bpy.ops.preferences.addon_expand(module=MODULE)
"""

_VIEW = """
areas = bpy.context.window_manager.windows[0].screen.areas
next(area for area in areas if area.type == "PREFERENCES").type = "VIEW_3D"
view3d()["area"].spaces.active.show_region_ui = True
"""

#: Chooses the tab once it is drawn.
_CHOOSE_TAB = """
ui = next(region for region in view3d()["area"].regions if region.type == "UI")
try:
    ui.active_panel_category = "Hemibake"
    answer = True
except TypeError:
    answer = False
"""

#: Notes images that the bake shows, the time of the first, and all times between two timer events during a
#: bake: wall time, CPU time of the window's thread and CPU time of all threads, with the stage.
_NOTE = """
import sys, time
shown = sys.modules[f"{MODULE}.operators.result.progress_images"].ProgressImages
owner = sys.modules[f"{MODULE}.operators.worker_manager"].owner
shown.count, shown.stalls, shown.last, shown.first, shown.begin = 0, [], None, 0.0, 0.0
def noted(self, lightmaps, show=shown.show, shown=shown, time=time):
    merged = show(self, lightmaps)
    shown.count += 1
    shown.first = shown.first or time.time() - shown.begin
    return merged
def watch(shown=shown, time=time, owner=owner):
    now = time.perf_counter(), time.thread_time(), time.process_time()
    if owner.running and not shown.begin:
        shown.begin = time.time()
    if shown.last and owner.running:
        shown.stalls.append([*(b - c for b, c in zip(now, shown.last)), owner.running.progress.stage])
    shown.last = now
    return 0.02
shown.show = noted
bpy.app.timers.register(watch)
"""

_STATE = """
import sys
owner = sys.modules[f"{MODULE}.operators.worker_manager"].owner
shown = sys.modules[f"{MODULE}.operators.result.progress_images"].ProgressImages
running = owner.running
progress = running.progress if running else owner.preparation
answer = {
    "runs": running is not None, "images": shown.count, "first": shown.first,
    "stage": progress.stage.rstrip(": 0123456789 of") if progress else "",
    "report": bpy.context.scene.hemibake.report,
    "overall": progress.overall if running else 0.0,
}
"""

#: The longest stalls.
_STALLS = """
import sys
shown = sys.modules[f"{MODULE}.operators.result.progress_images"].ProgressImages
answer = sorted(shown.stalls, reverse=True)[:5]
"""

#: Middle of the Bake button, found as a change of its looks.
_BAKE_BUTTON = (
    "import sys\n"
    "bake = sys.modules[f'{MODULE}.operators.bake'].HEMIBAKE_OT_bake\n"
    "bake.kept, bake.poll = bake.__dict__['poll'], classmethod(lambda cls, context: False)",
    "import sys\nbake = sys.modules[f'{MODULE}.operators.bake'].HEMIBAKE_OT_bake\nbake.poll = bake.kept",
)


#: Starts to bake if the click has missed.
_START = """
with bpy.context.temp_override(**view3d()):
    bpy.ops.hemibake.bake("INVOKE_DEFAULT")
"""


class _Record:
    """Pictures in a folder, and a row of the table for each.

    `write` compresses the pictures, which would take .7 s of a core beside the bake.
    """

    def __init__(self, window: Window, folder: Path) -> None:
        self._window, self._folder = window, folder
        self._rows: list[str] = []
        self._notes: list[str] = []
        self._pictures: list[tuple[np.ndarray, Path]] = []
        self._begin: tuple[float, float] | None = None
        folder.mkdir(parents=True, exist_ok=True)

    def begin(self) -> None:
        """Count time and CPU seconds from now on."""
        self._begin = time.perf_counter(), self._window.cpu_seconds

    @property
    def seconds(self) -> float:
        """Seconds since `begin`."""
        return time.perf_counter() - self._begin[0] if self._begin else 0.0

    def keep(self, name: str, note: str = "") -> None:
        """Add a picture of the screen and a row."""
        seconds, load = self.seconds, os.getloadavg()[0]
        used = self._window.cpu_seconds - self._begin[1] if self._begin else 0.0
        number = len(self._rows) + 1
        safe = "".join(letter if letter.isalnum() else " " for letter in name).split()
        path = self._folder / f"{number:02} {' '.join(safe).lower()}.png"
        self._pictures.append((self._window.screen().copy(), path))
        self._rows.append(f"| {number} | {name} | {seconds:.1f} | {used:.1f} | {load:.1f} | {note} |")
        print(self._rows[-1], flush=True)

    def note(self, sentence: str) -> None:
        """Add a sentence below the table."""
        self._notes.append(sentence)
        print(sentence, flush=True)

    def write(self, title: str) -> None:
        """Write the pictures, the table and the notes."""
        for pixels, path in self._pictures:
            write_picture(pixels, path)
        head = f"{title}\n\n| | moment | s | CPU s | load | |\n|---|---|---|---|---|---|\n"
        rows, notes = "\n".join(self._rows), "\n".join(self._notes)
        (self._folder / "times.md").write_text(f"{head}{rows}\n\n{notes}\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("package", type=Path, help="Hemibake's package for Linux")
    parser.add_argument("folder", type=Path, help="folder of the PNG files to write")
    parser.add_argument("--opencl", choices=("all", "none", "mesa"), default="all", help="OpenCL drivers")
    options = parser.parse_args()
    machine = find_machine()
    vendors = machine.new_folder()
    if options.opencl == "mesa":
        (machine.outside(vendors) / "mesa.icd").write_text("libRusticlOpenCL.so.1\n")
    drivers = {} if options.opencl == "all" else {"OCL_ICD_VENDORS": str(vendors)}
    if options.opencl == "mesa":  # the worker enables only drivers of GPUs
        drivers["RUSTICL_ENABLE"] = "llvmpipe"
    with Window(machine, options.package, is_new=True, environment=drivers) as window:
        record = _Record(window, options.folder)
        version = window.ask("bpy.app.version_string")
        try:
            _install(window, record)
            _bake(window, record)
        finally:
            record.write(f"Blender {version}, OpenCL drivers: {options.opencl}")


def _install(window: Window, record: _Record) -> None:
    """Install the package and look at Hemibake's tab."""
    window.run(_STAGE + _PREFERENCES)
    window.picture()
    record.keep("Preferences before")
    window.run(f"PACKAGE = {str(window.package)!r}\n{_INSTALL}")
    window.picture()
    record.keep("Installed")
    window.run(_VIEW)
    window.run(_NOTE)
    while not window.run(_CHOOSE_TAB):
        window.picture()
    record.begin()
    window.picture()
    record.keep("Panel")


def _find_button(window: Window) -> tuple[float, float]:
    """Return the middle of the Bake button; a slow machine may draw it late."""
    for _ in range(_TRIES):
        with suppress(RuntimeError):
            return window.button(*_BAKE_BUTTON)
    raise RuntimeError("The sidebar does not show the Bake button.")


def _bake(window: Window, record: _Record) -> None:
    """Click Bake and follow it to its end; pictures are taken once the window has drawn a new stage."""
    button = _find_button(window)
    time.sleep(max(0.0, _READING - record.seconds))
    record.keep("Before the click", window.run(_STATE)["stage"])
    window.click(*button)
    time.sleep(_REACTION)
    if not window.run(_STATE)["runs"]:  # the panel has moved its button meanwhile
        window.run(_START)
    record.keep("Click")
    stages, images, state = set[str](), 0, window.run(_STATE)
    while state["runs"] or not state["report"]:
        if state["images"] > images:
            images = state["images"]
            if images == 1:
                time.sleep(_POLL)
                record.keep("First light", state["stage"])
        if state["stage"] not in stages:
            stages.add(state["stage"])
            time.sleep(_POLL)
            record.keep(state["stage"] or "Waiting", f"{100 * state['overall']:.0f} %")
        time.sleep(_POLL)
        state = window.run(_STATE)
    seconds = json.loads(state["report"])["seconds"]
    record.keep("Done", f"bake {seconds['total']:.1f} s")
    window.still_picture(idle=True)
    record.keep("Final preview")
    record.note(f"After the click: first light {state['first']:.1f} s, done {seconds['total']:.1f} s.")
    record.note(", ".join(f"{name} {value:.1f}" for name, value in seconds.items()) + " s.")
    for wall, thread, process, stage in window.run(_STALLS):
        record.note(
            f"Stall of the window: {wall:.2f} s in {stage}, {thread:.2f} s of CPU time of its thread, "
            f"{process:.2f} s of all threads.\n"
        )


if __name__ == "__main__":
    main()
