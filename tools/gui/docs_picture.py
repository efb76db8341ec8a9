"""Takes README's picture of Blender: the Cornell box lit by its lightmap, and the lightmap.

python -m tools.gui.docs_picture out/package/hemibake-VERSION-linux_x64.zip docs/user/pictures/blender.png
"""

from __future__ import annotations

import argparse
from pathlib import Path

from .machines import find_machine
from .pictures import write_picture
from .window import Window

#: The room of the pictures.
_ROOM = Path(__file__).parents[2] / "examples" / "cornell_box.py"

#: Builds the room in place of the default scene.
BUILD_ROOM = f"""
SOURCE = {_ROOM.read_text(encoding="utf-8")!r}
for obj in list(bpy.data.objects):
    bpy.data.objects.remove(obj)
room = {{"__name__": "room"}}
exec(compile(SOURCE, "cornell_box.py", "exec"), room)
room["build"]()
"""

#: Starts to bake it.
_BAKE = """
bpy.context.scene.hemibake.resolution = 192
bpy.context.scene.hemibake.show_when_done = False
with bpy.context.temp_override(**view3d()):
    bpy.ops.hemibake.bake("INVOKE_DEFAULT")
"""

#: Shows it from its camera, rendered by Cycles in the preview, and the lightmap in place of the properties.
_SHOW = """
scene, view = bpy.context.scene, view3d()
scene.render.engine, scene.cycles.preview_samples = "CYCLES", 64
scene.view_settings.view_transform, scene.view_settings.exposure = "Standard", 0.6
with bpy.context.temp_override(**view):
    bpy.ops.hemibake.preview()
    bpy.ops.object.select_all(action="DESELECT")
view["area"].spaces.active.region_3d.view_perspective = "CAMERA"
view["area"].spaces.active.shading.type = "RENDERED"
scene.render.resolution_y = scene.render.resolution_x
overlay = view["area"].spaces.active.overlay
overlay.show_floor = overlay.show_axis_x = overlay.show_axis_y = overlay.show_cursor = False
area = next(area for area in view["screen"].areas if area.type == "PROPERTIES")
area.type = "IMAGE_EDITOR"
area.spaces.active.image = bpy.data.images["Lightmap"]
region = next(region for region in area.regions if region.type == "WINDOW")
with bpy.context.temp_override(window=view["window"], screen=view["screen"], area=area, region=region):
    bpy.ops.image.view_all(fit_view=True)
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("package", type=Path, help="Hemibake's package for Linux")
    parser.add_argument("picture", type=Path, help="PNG file to write")
    options = parser.parse_args()
    with Window(find_machine(), options.package) as window:
        window.run(BUILD_ROOM + _BAKE)
        window.wait_for("bpy.context.scene.hemibake.report")
        window.run(_SHOW)
        write_picture(window.still_picture(), options.picture)


if __name__ == "__main__":
    main()
