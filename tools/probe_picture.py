"""Draws the picture of light probes: a character in the sun and under a roof, lit by the preview.

python tools/probe_picture.py docs/user/pictures/light_probes.png
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from headless import blender, quiet_stdout

#: Size of the picture, pixels, and its samples.
_SIZE, _SAMPLES = (960, 480), 16

#: Name, side lengths, centre and colour of each box, m.
_BOXES = (
    ("Ground", (12, 8, 0.2), (0, 0, -0.1), (0.55, 0.5, 0.42)),
    ("Wall", (0.3, 6, 3), (4.2, 0, 1.5), (0.7, 0.12, 0.08)),
    ("Back", (4.6, 0.3, 3), (2.0, 2.8, 1.5), (0.7, 0.68, 0.62)),
    ("Roof", (4.6, 6, 0.25), (2.0, 0, 3.1), (0.7, 0.68, 0.62)),
)

#: Places of the character, m: in the sun, at the edge of the shade, and in the shade.
_PLACES = ((-3.0, 0.6, 0.8), (-0.3, 0.6, 0.8), (2.4, 0.6, 0.8))


def main() -> None:
    """Build, bake, and render the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("picture", type=Path)
    options = parser.parse_args()
    with blender(), quiet_stdout():
        import bpy

        _build()
        settings = bpy.context.scene.hemibake
        settings.quality, settings.resolution, settings.light_probes = "preview", 256, True
        bpy.ops.hemibake.bake()
        bpy.ops.hemibake.preview()
        _render(options.picture.resolve())


def _build() -> None:
    """Build a court with a roof, a sun and a sky, three characters, and a volume around them."""
    import bpy

    for name, size, place, colour in _BOXES:
        bpy.ops.mesh.primitive_cube_add(size=1, location=place)
        _dress(bpy.context.object, name, colour)
        bpy.context.object.scale = size
    for place in _PLACES:
        bpy.ops.mesh.primitive_monkey_add(size=1.6, location=place, rotation=(-0.3, 0, 0))
        bpy.ops.object.shade_smooth()
        _dress(bpy.context.object, "Character", (0.6, 0.6, 0.6))
        bpy.context.object.hemibake.role = "DYNAMIC"
    bpy.ops.object.light_add(type="SUN", rotation=(math.radians(22), math.radians(-14), 0))
    bpy.context.object.data.energy = 2.5
    world = bpy.data.worlds.new("Sky")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.2, 0.3, 0.5, 1)
    bpy.context.scene.world = world
    bpy.ops.object.lightprobe_add(type="VOLUME", location=(-0.2, -0.4, 1.4))
    volume = bpy.context.object
    volume.scale = (4.6, 2.8, 1.4)
    volume.data.resolution_x, volume.data.resolution_y, volume.data.resolution_z = 18, 11, 6
    bpy.ops.object.camera_add(location=(-1.0, -11.5, 2.6), rotation=(math.radians(84), 0, math.radians(-4)))
    bpy.context.object.data.lens = 42
    bpy.context.scene.camera = bpy.context.object


def _dress(obj, name: str, colour: tuple[float, float, float]) -> None:
    """Name an object, and give it a material without shine."""
    import bpy

    obj.name = name
    surface = bpy.data.materials.new(name)
    surface.use_nodes = True
    inputs = surface.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value, inputs["Specular IOR Level"].default_value = (*colour, 1), 0.0
    obj.data.materials.append(surface)


def _render(path: Path) -> None:
    """Render the preview; its materials only emit, so paths end at once."""
    import bpy

    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples, scene.cycles.max_bounces = "CPU", _SAMPLES, 0
    scene.cycles.use_denoising = False
    scene.render.resolution_x, scene.render.resolution_y = _SIZE
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform, scene.view_settings.exposure = "Standard", 0.4
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
