"""Runs in the Blender of a window: answers questions of the process that drives it.

A question is the file question.py of the folder BLENDER_GUI, written between two events; the answer is
answer.json, the value of `answer` or a traceback. It stands alone, and is copied to where Blender finds it.
"""

import json
import os
import traceback
from pathlib import Path

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

FOLDER = Path(os.environ["BLENDER_GUI"])
MODULE = "bl_ext.user_default.hemibake"


def view3d():
    """Return window, screen, area and region of the first 3D view, for `temp_override`."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    return {"window": window, "screen": window.screen, "area": area, "region": region}


def rectangle(kind="WINDOW"):
    """Return left, top, right and bottom of a region of the 3D view, in pixels of the screen."""
    view = view3d()
    region = next(region for region in view["area"].regions if region.type == kind)
    top = view["window"].height - region.y - region.height
    return region.x, top, region.x + region.width, top + region.height


def pixel_of(point):
    """Return where the 3D view shows a point of the world, in pixels of the screen."""
    view = view3d()
    x, y = location_3d_to_region_2d(view["region"], view["area"].spaces.active.region_3d, Vector(point))
    left, _, _, bottom = rectangle()
    return left + x, bottom - y


def redraw():
    """Draw everything again once the question is answered."""
    for area in bpy.context.window_manager.windows[0].screen.areas:
        area.tag_redraw()


def answer_questions():
    """Answer a question if there is one; come back soon."""
    question = FOLDER / "question.py"
    if question.exists():
        code = question.read_text()
        question.unlink()
        names = {"answer": None}
        try:
            exec(compile(code, "question.py", "exec"), globals(), names)
            reply = {"value": names["answer"]}
        except Exception:  # noqa: BLE001 whatever it is, the asker is told
            reply = {"error": traceback.format_exc()}
        unfinished = FOLDER / "answer.tmp"
        unfinished.write_text(json.dumps(reply))
        unfinished.replace(FOLDER / "answer.json")
    return 0.05


def show_tab():
    """Select Hemibake's tab of the sidebar; it must be drawn once before it can be selected."""
    ui = next(region for region in view3d()["area"].regions if region.type == "UI")
    try:
        ui.active_panel_category = "Hemibake"
    except TypeError:
        return 0.5
    bpy.app.timers.register(answer_questions, persistent=True)
    return None


def begin():
    """Open the sidebar, with Hemibake's tab once Hemibake is installed."""
    view3d()["area"].spaces.active.show_region_ui = True
    if MODULE in bpy.context.preferences.addons:
        bpy.app.timers.register(show_tab, first_interval=0.5)
    else:
        bpy.app.timers.register(answer_questions, persistent=True)


bpy.context.preferences.view.show_splash = False
bpy.app.timers.register(begin, first_interval=0.5)
