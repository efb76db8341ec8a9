"""Take pictures of all panels for the guide, after a bake of the Cornell box in a window of Blender.

python -m tools.gui.panel_pictures out/package/hemibake-VERSION-linux_x64.zip docs/user/pictures
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from .docs_picture import BUILD_ROOM
from .machines import find_machine
from .pictures import write_picture
from .window import Window

#: Bakes the room with two outputs and a light group, and checks it.
_BAKE = """
scene = bpy.context.scene
scene.hemibake.show_when_done = False
scene.hemibake.outputs = {"combined", "ambient_occlusion", "light_groups"}
bpy.context.view_layer.lightgroups.add(name="Ceiling")
bpy.data.objects["Light"].lightgroup = "Ceiling"
with bpy.context.temp_override(**view3d()):
    bpy.ops.hemibake.check()
    bpy.ops.hemibake.bake("INVOKE_DEFAULT")
"""

#: Shows the panels as after a usual bake, without a grid behind them.
_AFTER = """
bpy.context.scene.hemibake.show_when_done = True
bpy.context.view_layer.objects.active = bpy.data.objects["Tall Box"]
view3d()["area"].spaces.active.overlay.show_overlays = False
"""

#: Width of the edge of an area, pixels.
_EDGE = 3

#: Panels of each picture of the sidebar, by the ends of their names.
_PAGES = {
    "panel_bake": ("bake", "check", "last_bake"),
    "panel_objects": ("object", "lightmaps"),
    "panel_outputs": ("outputs",),
    "panel_light_groups": ("light_groups",),
    "panel_probes": ("light_probes", "reflection_cubes"),
    "panel_advanced": ("advanced", "light", "texels", "uvs"),
    "panel_charts": ("charts", "memory", "paper"),
}

#: Shows copies of the panels in PAGE and no others: copies with new names are open.
_SHOW_PAGE = """
import sys
panels = sys.modules[f"{MODULE}.panels"]
known = {cls.__name__.partition("_PT_")[2]: cls for cls in panels.CLASSES if "_PT_" in cls.__name__}
for cls in {**known, **getattr(panels, "copies", {})}.values():
    if cls.is_registered and "material_tab" not in cls.__name__:
        bpy.utils.unregister_class(cls)
panels.copies = {}
for name in PAGE:
    parent = getattr(known[name], "bl_parent_id", "").partition("_PT_")[2]
    facts = {"bl_options": set(), "bl_idname": f"{known[name].__name__}_shown"}
    facts["bl_parent_id"] = f"HEMIBAKE_PT_{parent}_shown" if parent in PAGE else ""
    panels.copies[f"{name} "] = type(f"{known[name].__name__}_shown", (known[name],), facts)
    bpy.utils.register_class(panels.copies[f"{name} "])
view3d()["area"].tag_redraw()
"""

#: Chooses Hemibake's tab, once it is drawn again.
_CHOOSE_TAB = """
ui = next(region for region in view3d()["area"].regions if region.type == "UI")
try:
    ui.active_panel_category = "Hemibake"
    answer = True
except TypeError:
    answer = False
"""

#: Shows the material tab while the lightmap is shown, in Solid shading: software draws materials in minutes.
_SHOW_MATERIAL = """
with bpy.context.temp_override(**view3d()):
    bpy.ops.hemibake.preview()
view3d()["area"].spaces.active.shading.type = "SOLID"
area = next(area for area in view3d()["screen"].areas if area.type == "PROPERTIES")
bpy.context.view_layer.objects.active = bpy.data.objects["Tall Box"]
area.spaces.active.context = "MATERIAL"
"""

#: Shows the preferences of the add-on in place of the 3D view.
_SHOW_PREFERENCES = """
area, window = view3d()["area"], bpy.context.window_manager.windows[0]
bpy.context.preferences.active_section = "ADDONS"
bpy.context.window_manager.addon_search = "Hemibake"
area.type = "PREFERENCES"
with bpy.context.temp_override(window=window):
    bpy.ops.preferences.addon_expand(module=MODULE)
"""

_AREA = """
areas = {area.type: area for area in bpy.context.window_manager.windows[0].screen.areas}
area = areas["%s"]
region = next(region for region in area.regions if region.type == "WINDOW")
top = bpy.context.window_manager.windows[0].height - region.y - region.height
answer = region.x, top, region.x + region.width, top + region.height
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("package", type=Path, help="Hemibake's package for Linux")
    parser.add_argument("folder", type=Path, help="folder of the PNG files to write")
    options = parser.parse_args()
    with Window(find_machine(), options.package) as window:
        window.run(BUILD_ROOM + _BAKE)
        window.wait_for("bpy.context.scene.hemibake.report")
        window.run(_AFTER)
        for name, page in _PAGES.items():
            window.run(f"PAGE = {page!r}\n{_SHOW_PAGE}")
            _choose_tab(window)
            _keep(window, window.ask("rectangle('UI')"), options.folder, name)
        window.run(_SHOW_MATERIAL)
        _keep(window, window.run(_AREA % "PROPERTIES"), options.folder, "panel_material")
        window.run(_SHOW_PREFERENCES)
        window.move(0, 0)  # no tool-tip
        _keep(window, window.run(_AREA % "PREFERENCES"), options.folder, "panel_preferences")


def _choose_tab(window: Window) -> None:
    """Choose Hemibake's tab; the sidebar must be drawn with the new panels first."""
    for _ in range(20):
        window.picture()
        if window.run(_CHOOSE_TAB):
            return
    raise RuntimeError("The sidebar does not show Hemibake's tab.")


def _keep(window: Window, box: tuple[int, int, int, int], folder: Path, name: str) -> None:
    """Write the part of the screen inside a box (left, top, right, bottom), without empty rows at its end."""
    left, top, right, bottom = box
    picture = window.still_picture()[top : bottom - _EDGE, left : right - _EDGE]
    filled = np.flatnonzero((picture != picture[-1:]).any(axis=(1, 2)))
    write_picture(picture[: filled[-1] + 8], folder / f"{name}.png")


if __name__ == "__main__":
    main()
