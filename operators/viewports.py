"""Shading of 3D views, and restarts of renders in them."""

from __future__ import annotations

import bpy

#: Custom property of a screen: indices of areas that were switched from Solid to Material Preview.
_SWITCHED = "hemibake_switched_areas"


def show_materials(context: bpy.types.Context) -> None:
    """Switch the 3D view of the context from Solid shading to Material Preview."""
    area, screen = context.area, context.screen
    if area is None or area.type != "VIEW_3D" or area.spaces.active.shading.type != "SOLID":
        return
    area.spaces.active.shading.type = "MATERIAL"
    screen[_SWITCHED] = sorted({*screen.get(_SWITCHED, ()), list(screen.areas).index(area)})


def show_solid_again() -> None:
    """Switch views back to Solid that `show_materials` switched, if they still show Material Preview."""
    for screen in [screen for screen in bpy.data.screens if _SWITCHED in screen]:
        for index, area in enumerate(screen.areas):
            space = area.spaces.active
            if index in screen[_SWITCHED] and space.type == "VIEW_3D" and space.shading.type == "MATERIAL":
                space.shading.type = "SOLID"
        del screen[_SWITCHED]


def restart_renders(manager: bpy.types.WindowManager) -> None:
    """Restart Cycles' renders in 3D views, since Cycles does not detect new pixels of an image."""
    for window in manager.windows:
        spaces = [area.spaces.active for area in window.screen.areas if area.type == "VIEW_3D"]
        for space in spaces:
            if space.shading.type == "RENDERED" and window.scene.render.engine == "CYCLES":
                space.shading.type = "SOLID"
                space.shading.type = "RENDERED"


def redraw(kind: str) -> None:
    """Let Blender draw all editors of a type again, such as "VIEW_3D"."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == kind:
                area.tag_redraw()
